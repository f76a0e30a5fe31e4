cimport cython
from libc cimport math
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport edge_equations, group_motion, lengths, object_belief, object_prediction, range_belief, rebel_detection, situation, speed_change, turmoil
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.circles cimport Ids
from lcf_edge.filter.coarse_circles cimport CoarseGroups
from lcf_edge.filter.coarse_motion cimport CoarseMotion
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns, ObjectColumns
from lcf_edge.filter.group_motion cimport MotionSums
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.patches cimport Patches
from lcf_edge.filter.range_belief cimport Belief, Evidence
from lcf_edge.filter.rebel_detection cimport Verdicts
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef int MIN_EDGES
cdef double SIDE_GAP
cdef double STACK_GAP
cdef double WIDE_GAP
cdef double TOWER_GAP
cdef double LIKE_SIGMAS
cdef double LIKE_SHARE
cdef double VERY_LIKE_SHARE
cdef double MAX_SIGMAS_SHARE
cdef double LIKE_SHARE_OF_LINK
cdef double STRAY_SIGMAS
cdef double STRAY_SHARE
cdef double JOIN_SHARE
cdef double SIDE_REACH
cdef double STACK_REACH
cdef double INNER_SHARE
cdef double GROUND_SIGMAS
cdef double GROUND_SHARE
cdef int MAX_BENEATH
cdef int ALL
cdef double NOISE_GAIN
cdef double NEWS_SIGMAS
cdef double GROWS_S
cdef double SHRINKS_S
cdef double TURMOIL_HZ
cdef double FRAMES_UNREPORTED
cdef double UNSURE
cdef double RECENT_S
cdef int UNKNOWN
cdef int SEEN
cdef double INFINITY
cdef double NAN

cdef class Squares:
    cdef readonly MotionSums parts, bounds
    cdef MotionSums wholes
    cdef int[::1] agreeing
    cdef readonly int[::1] members
    cdef int[::1] resting
    cdef int[::1] through
    cdef unsigned char[::1] odd, obedient
    cdef double[::1] rows
    cdef int[::1] sides
    cdef Evidence evidence
    cdef Belief belief

cpdef bint belongs(ObjectColumns objects, Py_ssize_t o, CircleColumns circles, Py_ssize_t c, MotionSums parts, Situation around, Settings settings) noexcept nogil
cdef double extent_of(ObjectColumns objects, Py_ssize_t o, CircleColumns circles, Py_ssize_t c) noexcept nogil
cdef bint is_within(ObjectColumns objects, Py_ssize_t o, CircleColumns circles, Py_ssize_t c, double side_px, double stack_px) noexcept nogil
cdef bint is_beside(ObjectColumns objects, Py_ssize_t o, CircleColumns circles, Py_ssize_t c, Settings settings) noexcept nogil
@cython.locals(weight=double)
cdef bint is_moving(MotionSums parts, Py_ssize_t c, Settings settings) noexcept nogil
cdef bint shows_object(MotionSums parts, Py_ssize_t c, Situation around, Settings settings) noexcept nogil
cdef bint expands_alike(ObjectColumns objects, Py_ssize_t o, MotionSums parts, Py_ssize_t c, double looming) noexcept nogil
cdef bint moves_alike(ObjectColumns objects, Py_ssize_t o, MotionSums parts, Py_ssize_t c, double share, Situation around, Settings settings) noexcept nogil
cdef void measure_circles(MotionSums parts, CircleColumns circles, Verdicts verdicts, EdgeColumns edges, Patches patches, CoarseMotion coarse, CoarseGroups coarse_groups, Baselines baselines, Situation around) noexcept nogil
@cython.locals(agrees=bint)
cdef void keep_members(ObjectColumns objects, Squares squares, CircleColumns circles, Situation around, Settings settings) noexcept nogil
@cython.locals(nearest=int, least=double, meets=bint)
cdef int object_in_turmoil(ObjectColumns objects, CircleColumns circles, Py_ssize_t c) noexcept nogil
@cython.locals(least=double)
cdef int nearest_object(ObjectColumns objects, Squares squares, CircleColumns circles, Py_ssize_t c, Situation around, Settings settings) noexcept nogil
cdef int free_row(ObjectColumns objects) noexcept nogil
cdef int row_to_spare(ObjectColumns objects, Settings settings) noexcept nogil
cdef void give_birth(ObjectColumns objects, Py_ssize_t o, Settings settings, Ids ids) noexcept nogil
cdef void found(ObjectColumns objects, Py_ssize_t o, Squares squares, CircleColumns circles, Py_ssize_t c, Situation around, Settings settings, Ids ids) noexcept nogil
cdef void found_in_turmoil(ObjectColumns objects, Py_ssize_t o, CircleColumns circles, Py_ssize_t c, Situation around, Settings settings, Ids ids) noexcept nogil
@cython.locals(in_turmoil=bint)
cdef int gather(ObjectColumns objects, Squares squares, CircleColumns circles, EdgeColumns edges, Situation around, Settings settings, Ids ids) noexcept nogil
cdef void leave(CircleColumns circles, Py_ssize_t o, int to) noexcept nogil
cdef void hand_over(EdgeColumns edges, Py_ssize_t o, int to) noexcept nogil
@cython.locals(measured=bint, o=int)
cdef bint belong_together(ObjectColumns objects, Py_ssize_t a, Py_ssize_t b, Squares squares, CircleColumns circles, Situation around, Settings settings) noexcept nogil
cdef void unite(ObjectColumns objects, Squares squares, CircleColumns circles, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cdef void update_rate(ObjectColumns objects, Py_ssize_t o, double h_m, double h_q, double value, double variance, double speed_mps) noexcept nogil
@cython.locals(repeated=double, rate=double, variance=double, speed_mps=double)
cdef void observe(ObjectColumns objects, Py_ssize_t o, MotionSums wholes, Situation around) noexcept nogil
cdef void show(ObjectColumns objects, Py_ssize_t o, MotionSums wholes, Situation around) noexcept nogil
cdef void fit(ObjectColumns objects, Py_ssize_t o, double left, double right, double top, double bottom, Situation around) noexcept nogil
@cython.locals(time_s=double)
cdef double follow(double side, double shown, double outwards, Situation around) noexcept nogil
cdef void take_place(ObjectColumns objects, Py_ssize_t o, CircleColumns circles, Py_ssize_t c, Situation around) noexcept nogil
cdef bint go_on_in_turmoil(ObjectColumns objects, Py_ssize_t o, CircleColumns circles, Situation around, Settings settings) noexcept nogil
cdef bint obeys(ObjectColumns objects, Py_ssize_t o, Verdicts verdicts, Py_ssize_t j, EdgeColumns edges, Baselines baselines, double share, Situation around) noexcept nogil
cdef void set_reach(MotionSums bounds, MotionSums wholes, Py_ssize_t o) noexcept nogil
cdef bint is_in_reach(MotionSums bounds, Py_ssize_t o, double x, double y) noexcept nogil
cdef double still_px(Verdicts verdicts, Py_ssize_t j) noexcept nogil
@cython.locals(moves=bint)
cdef void take_others(ObjectColumns objects, Squares squares, Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
@cython.locals(at_rest=bint, other=bint)
cdef void see_through(ObjectColumns objects, Squares squares, Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
cdef bint flows_as_ground(Verdicts verdicts, Py_ssize_t j, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
@cython.locals(foot=int, least=int, wrong=int)
cdef void find_foot(Squares squares, Py_ssize_t o, int listed, Situation around) noexcept nogil
@cython.locals(listed=int, is_own=bint)
cdef void find_ground(ObjectColumns objects, Py_ssize_t o, Squares squares, Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
@cython.locals(reach_x=double, reach_y=double)
cdef bint is_near(ObjectColumns objects, Py_ssize_t o, double x, double y) noexcept nogil
@cython.locals(beside=bint)
cdef int square_of(ObjectColumns objects, CircleColumns circles, EdgeColumns edges, Py_ssize_t i) noexcept nogil
@cython.locals(share=double)
cdef void count_members(ObjectColumns objects, Squares squares, CircleColumns circles, Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
@cython.locals(share=double, is_own=bint)
cdef void take_members(ObjectColumns objects, Squares squares, CircleColumns circles, Verdicts verdicts, EdgeColumns edges, CoarseMotion coarse, CoarseGroups coarse_groups, Baselines baselines, Situation around) noexcept nogil
cdef double belief_in(ObjectColumns objects, Py_ssize_t o, MotionSums wholes, Situation around, Settings settings) noexcept nogil
cdef void measure(ObjectColumns objects, Py_ssize_t o, MotionSums wholes, int place, Situation around) noexcept nogil
cdef void see_at_rest(ObjectColumns objects, Py_ssize_t o, Situation around) noexcept nogil
cdef void renew_numbers(ObjectColumns objects, Py_ssize_t o, Squares squares, bint unmeasured, ImagePlane plane, Situation around) noexcept nogil
@cython.locals(remnant=bint, gone=bint, shown=bint, count=int, own=int, through=int, place=int)
cpdef int update(Squares squares, ObjectColumns objects, CircleColumns circles, Verdicts verdicts, EdgeColumns edges, Patches patches, CoarseMotion coarse, CoarseGroups coarse_groups, Baselines baselines, ImagePlane plane, Situation around, Settings settings, Ids ids) noexcept nogil
