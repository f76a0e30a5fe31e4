cimport cython
from libc cimport math
from lcf_edge.filter cimport flow, image_plane, lengths, path, rounding
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.flow cimport Homography
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.situation cimport Situation

cdef int SIDE
cdef int SAMPLES
cdef double SHARPNESS
cdef double EFFECTIVE_SHARE
cdef double MIN_HALF_PX
cdef double MAX_HALF_PX
cdef double HALF_WIDTH_SHARE
cdef double BESIDE
cdef double BESIDE_HALVES
cdef double KEPT_REACHES
cdef double NEAREST_S
cdef double ROW_SHARE
cdef double APART
cdef int BIRTHS
cdef double MIN_CONTRAST_GREY
cdef double NOISE_GREY
cdef double MAX_SCALE_SIGMA
cdef double MIN_ALONE
cdef double MIN_SCALE_SIGMA
cdef double FAR_PX
cdef int ROUNDS
cdef double SMALL_PX
cdef double SMALL_SHARE
cdef double STEP_SHARE
cdef double STEP_SCALE
cdef double LIKENESS
cdef int MAX_MISSES
cdef double MIN_SCALE
cdef double MAX_SCALE
cdef double LIFE_S
cdef double SUCCESSOR_SHARE
cdef double MIN_SPEED_MPS

cdef class Patches:
    cdef readonly int capacity
    cdef readonly unsigned char[::1] active
    cdef readonly int[::1] misses, circle
    cdef readonly double[::1] x, y, scale, sigma, elapsed_s, depth_m, inverse, inverse_sigma
    cdef double[::1] first_x, first_y, half_px
    cdef readonly double[::1] contrast, unit
    cdef double[::1] weight, sampled, offset
    cdef readonly double[:, ::1] grey, across, down, inverted
    cdef double[:, ::1] growing, stretching, sums, coupled
    cdef readonly double[::1] alone, stretch
    cdef double u, v, right_u, right_v, down_u, down_v, mean, square, shared, on_across, on_down, on_growing, on_stretching, tried

@cython.locals(k=int)
cdef void weigh(Patches patches) noexcept nogil
cpdef void derotate(Patches patches, Homography h) noexcept nogil
cpdef void predict(Patches patches, Situation around) noexcept nogil
cpdef void correct_way(Patches patches, double factor) noexcept nogil
cdef bint locate(Patches patches, ImagePlane plane, double x, double y, double half) noexcept nogil
@cython.locals(row=int, column=int, left=int, top=int, at=Py_ssize_t, upper=double, lower=double)
cdef void look(Patches patches, const unsigned char[::1] image, Py_ssize_t width) noexcept nogil
@cython.locals(k=int)
cdef void compare(Patches patches, Py_ssize_t p) noexcept nogil
cdef double bounded(double value, double most) noexcept nogil
cdef double step(Patches patches, Py_ssize_t p, double gain) noexcept nogil
@cython.locals(change=double, likeness=double, rest=double)
cdef bint find(Patches patches, Py_ssize_t p, const unsigned char[::1] image, ImagePlane plane) noexcept nogil
cpdef void follow(Patches patches, const unsigned char[::1] image, ImagePlane plane) noexcept nogil
cdef double half_side(Situation around) noexcept nogil
cdef double reach_px(double half, Situation around) noexcept nogil
cdef double beside_px(double x, Situation around) noexcept nogil
@cython.locals(reach=double, away=double, p=int)
cdef void retire(Patches patches, double half, Situation around) noexcept nogil
cdef int free_row(Patches patches) noexcept nogil
cdef bint is_covered(Patches patches, double x, double y, double half) noexcept nogil
@cython.locals(best=int, least=double, i=int)
cdef int next_place(Patches patches, EdgeColumns edges, double half, Situation around) noexcept nogil
@cython.locals(mean=double, k=int)
cpdef bint give_birth(Patches patches, Py_ssize_t p, double x, double y, double half, const unsigned char[::1] image, ImagePlane plane) noexcept nogil
cdef double slope(Patches patches, Py_ssize_t p, int k, int place, int stride) noexcept nogil
@cython.locals(square=double, xx=double, xy=double, xs=double, yy=double, ys=double, ss=double, xt=double, yt=double, st=double, tt=double, k=int, row=int, column=int)
cdef bint set_template(Patches patches, Py_ssize_t p) noexcept nogil
@cython.locals(i=int, p=int)
cpdef void renew(Patches patches, EdgeColumns edges, const unsigned char[::1] image, ImagePlane plane, Situation around) noexcept nogil
