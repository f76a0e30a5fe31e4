cimport cython
from libc cimport math
from lcf_edge.filter cimport block_matching, flow, image_plane, lengths, object_belief, situation, speed_change
from lcf_edge.filter.block_matching cimport Blocks
from lcf_edge.filter.coarse_motion cimport CoarseMotion
from lcf_edge.filter.columns cimport EdgeColumns, ObjectColumns
from lcf_edge.filter.flow cimport Homography
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double WANDER_MPS
cdef double MAX_LAG
cdef double EDGE_PX
cdef int SURE_EDGES
cdef double COAST_S
cdef double HIDDEN_S
cdef double OUTSIDE_S
cdef double COMING_S
cdef double NEAR_S
cdef double LINGERS_S
cdef double SAME_PLACE_M
cdef double STARTS_S
cdef double THROUGH_S
cdef int MIN_THROUGH
cdef double THROUGH_SHARE
cdef double RESTING_S
cdef double NEAR_M
cdef double SOON_S
cdef double REMNANT_SHARE
cdef int LOOK_SIDE
cdef double CHANGED_GREY
cdef double LIGHT_SHARE
cdef double LOOKS_AFTER
cdef int UNKNOWN
cdef int SAME
cdef int CHANGED
cdef int NOT_YET
cdef int WATCHED
cdef int MOVED
cdef int NO_LONGER
cdef int EMPTY
cdef double LEAVES_S
cdef double LOSES_HZ
cdef double PASSED_M
cdef int HIDDEN
cdef int COASTING
cdef double INFINITY
cdef double NAN

cpdef void derotate(ObjectColumns objects, Homography h) noexcept nogil
cdef double looming_at(ObjectColumns objects, Py_ssize_t o, double speed_mps) noexcept nogil
cdef double velocity_x(ObjectColumns objects, Py_ssize_t o, double x, double looming, Situation around) noexcept nogil
cdef double velocity_y(double y, double looming, Situation around) noexcept nogil
@cython.locals(looming=double)
cdef double x_in(ObjectColumns objects, Py_ssize_t o, double time_s, Situation around) noexcept nogil
cdef double bounded(double change) noexcept nogil
cdef void forget_motion(ObjectColumns objects, Py_ssize_t o) noexcept nogil
@cython.locals(inverse=double)
cpdef void predict(ObjectColumns objects, ImagePlane plane, Situation around, Settings settings) noexcept nogil
cdef bint is_in_image(ObjectColumns objects, Py_ssize_t o, double x, ImagePlane plane) noexcept nogil
@cython.locals(left=double, right=double)
cdef bint is_in_sight(ObjectColumns objects, Py_ssize_t o, ImagePlane plane) noexcept nogil
cdef bint is_passed(ObjectColumns objects, Py_ssize_t o) noexcept nogil
cdef bint is_beside(ObjectColumns objects, Py_ssize_t o, Situation around, Settings settings) noexcept nogil
cdef double outside_s(ObjectColumns objects, Py_ssize_t o, Situation around) noexcept nogil
cdef bint comes(ObjectColumns objects, Py_ssize_t o, Situation around) noexcept nogil
@cython.locals(is_lost=bint)
cdef bint lingers(ObjectColumns objects, Py_ssize_t o, Situation around) noexcept nogil
cdef bint is_in_middle(ObjectColumns objects, Py_ssize_t o, double x, double y) noexcept nogil
@cython.locals(through=int, is_fixed=bint)
cdef int fixed_behind(ObjectColumns objects, Py_ssize_t o, EdgeColumns edges) noexcept nogil
@cython.locals(across=bint)
cdef bint is_behind(ObjectColumns objects, Py_ssize_t o) noexcept nogil
@cython.locals(apart_m=double, across=bint)
cdef bint is_in_place_of(ObjectColumns objects, Py_ssize_t o, Py_ssize_t other) noexcept nogil
@cython.locals(since_s=double, moves=double, aside_m=double, ahead_m=double, own_m=double, other_m=double, half_m=double, right_m=double, apart_m=double)
cdef bint has_left(ObjectColumns objects, Py_ssize_t o, Py_ssize_t other, Situation around) noexcept nogil
cdef int object_in_place_of(ObjectColumns objects, Py_ssize_t o, Situation around) noexcept nogil
cdef void take_over(ObjectColumns objects, Py_ssize_t o, Py_ssize_t by) noexcept nogil
@cython.locals(hidden=bint, patience_s=double)
cdef bint is_remnant(ObjectColumns objects, Py_ssize_t o, int count, ImagePlane plane, Situation around) noexcept nogil
cdef bint is_left_over(ObjectColumns objects, Py_ssize_t o, int own, Situation around) noexcept nogil
cdef double near_s(ObjectColumns objects, Py_ssize_t o, Situation around) noexcept nogil
@cython.locals(is_trusted=bint, is_large=bint, is_soon=bint)
cdef bint is_met_soon(ObjectColumns objects, Py_ssize_t o, Settings settings) noexcept nogil
@cython.locals(has_gone=bint)
cdef void go_on(ObjectColumns objects, Py_ssize_t o, bint gone, int through, EdgeColumns edges, ImagePlane plane, Situation around, Settings settings) noexcept nogil
@cython.locals(across=double, down=double, x=double, y=double)
cdef int grey(ObjectColumns objects, Py_ssize_t o, int k, CoarseMotion coarse, ImagePlane plane) noexcept nogil
@cython.locals(k=int)
cdef void look(ObjectColumns objects, Py_ssize_t o, CoarseMotion coarse, ImagePlane plane) noexcept nogil
@cython.locals(k=int, now=int, change=double, count=double, before=double, gained=double, squares=double, light=double)
cdef bint looks_different(ObjectColumns objects, Py_ssize_t o, CoarseMotion coarse, ImagePlane plane) noexcept nogil
@cython.locals(just_lost=bint)
cdef void stir(ObjectColumns objects, Py_ssize_t o, CoarseMotion coarse, ImagePlane plane, Situation around) noexcept nogil
@cython.locals(is_well_seen=bint, is_empty=bint, stopped=bint, stands=bint)
cdef int watch(ObjectColumns objects, Py_ssize_t o, int count, int own, int through, CoarseMotion coarse, ImagePlane plane, Situation around) noexcept nogil
