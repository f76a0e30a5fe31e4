cimport cython
from libc cimport math
from lcf_edge.filter cimport flow, image_plane, least_squares, matching
from lcf_edge.filter.columns cimport CircleColumns, CornerColumns, EdgeColumns, PsiColumns
from lcf_edge.filter.flow cimport Homography, Pinhole
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.least_squares cimport NormalEquations
from lcf_edge.filter.matching cimport CornerIndex
from lcf_edge.filter.settings cimport Settings

cdef double CORNER_SIGMA_PX
cdef int MIN_EDGES
cdef int MAX_EDGES
cdef int ROUNDS
cdef double WEAK_RAD
cdef double SCATTER
cdef double MIN_SIGMA_PX
cdef int MIN_SOUGHT
cdef double FOUND_PX

cdef class OffLine:
    cdef readonly Py_ssize_t count
    cdef readonly int[::1] row
    cdef readonly double[::1] pitch, yaw, roll, px, alone, alone_sigma
    cdef NormalEquations equations
    cdef readonly double turn_x, turn_y, turn_z, sigma

cpdef void derotate_edges(EdgeColumns edges, Homography h, double roll) noexcept nogil
cpdef void derotate_circles(CircleColumns circles, Homography h, double roll) noexcept nogil
cpdef void derotate_psi(PsiColumns psi, Homography h) noexcept nogil
cdef bint shows_rotation(EdgeColumns edges, Py_ssize_t i, double tr_s) noexcept nogil
cpdef bint measure_off_line(OffLine off, EdgeColumns edges, CornerColumns corners, Pinhole pinhole, Settings settings) noexcept nogil
cpdef void off_line(OffLine off, EdgeColumns edges, Py_ssize_t i, CornerColumns corners, Pinhole pinhole) noexcept nogil
@cython.locals(weak=double, shared=double, variance=double, inflation=double)
cpdef void missing_rotation(OffLine off, double focal, double prior_sigma_rad) noexcept nogil
@cython.locals(scatter=double)
cdef double weigh(OffLine off, double prior) noexcept nogil
@cython.locals(sought=int, found=int)
cpdef double found_share(CornerIndex index, ImagePlane plane, EdgeColumns edges, CornerColumns corners, Homography h, double dt_s, Settings settings) noexcept nogil
