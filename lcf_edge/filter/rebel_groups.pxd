cimport cython
from libc cimport math
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport lengths, rebel_detection, situation
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.circles cimport Members
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.rebel_detection cimport Verdicts
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double VELOCITY_NOISE_PX
cdef double LIKE_SPEED
cdef double RATE_SIGMAS
cdef double LEADER_HEIGHT_SHARE
cdef double DOUBTFUL_HEIGHT_SHARE
cdef int MANY_REBELS
cdef double MIRROR_NOISE_PX
cdef double MIRROR_SIGMAS
cdef double MOVER_SHARE
cdef double LIKELY_OWN_S
cdef double SEEN_TO_MOVE_PX
cdef double OWN_SHARE
cdef double SPREAD_NOISE_PX
cdef int STRAY_ROUNDS
cdef double STRAY_SIGMAS
cdef double STRAY_SHARE
cdef double SPREAD_SIGMAS
cdef double SWING_SIGMAS
cdef double SPREAD_SHARE
cdef double MIN_EXTENT2_PX
cdef double FASTEST_EXPANSION
cdef double TURN_SHARE
cdef double LINK_SHARE
cdef double FAR_LINK_SHARE
cdef double FAR_LINK_RAD
cdef double NEAR_LINK_M
cdef double NEAR_LIKE_HZ
cdef double STAND_SHARE
cdef double FAR_LIKE_SPEED
cdef double INFINITY

cdef class RebelGroups:
    cdef public Py_ssize_t count, groups
    cdef readonly int[::1] verdict, label
    cdef int[::1] group
    cdef readonly double[::1] vx, vy, elapsed_s, inverse
    cdef readonly Members members
    cdef readonly double[::1] mean_s, closing_mps, focus_rate, focus_r2
    cdef double[::1] mean_vx, mean_vy, below2, below_vy
    cdef readonly double[::1] then_x, then_y, spread
    cdef double[::1] rate_below, r2_below2, below2_vy, below4, spreading
    cdef readonly double[::1] expansion
    cdef double[::1] weight, weighed_rate, left, right, top, bottom
    cdef readonly int[::1] standing, inwards, flowing, circle
    cdef int[::1] best_circle, best_group
    cdef int[:, ::1] votes
    cdef unsigned char[::1] odd, updated, missed

cpdef void take_rebels(RebelGroups groups, Py_ssize_t rebels, int[::1] breaking, Verdicts verdicts, EdgeColumns edges, Baselines baselines) noexcept nogil
cdef double noise_between(RebelGroups groups, Py_ssize_t a, Py_ssize_t b) noexcept nogil
cdef bint are_linked(RebelGroups groups, Py_ssize_t a, Py_ssize_t b, double dx, double dy, double distance, Situation around, Settings settings) noexcept nogil
cdef bint stand_together(RebelGroups groups, Py_ssize_t a, Py_ssize_t b, double distance, Situation around) noexcept nogil
cdef int lowest_label(RebelGroups groups, int k) noexcept nogil
cdef void join(RebelGroups groups, int a, int b) noexcept nogil
@cython.locals(n=Py_ssize_t, reach=double, most=double, x=double, y=double, flows=bint)
cdef bint are_on_body(RebelGroups groups, Py_ssize_t a, Py_ssize_t b, EdgeColumns edges, Py_ssize_t i, Py_ssize_t k, Situation around, Settings settings) noexcept nogil
@cython.locals(linked=bint)
cpdef void cluster(RebelGroups groups, Verdicts verdicts, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cdef void join_sparse(RebelGroups groups, Verdicts verdicts, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cdef double near_link_px(double y, Situation around) noexcept nogil
cdef void join_near(RebelGroups groups, Verdicts verdicts, EdgeColumns edges, Situation around, int support) noexcept nogil
cdef void measure_sizes(RebelGroups groups) noexcept nogil
cpdef void number_groups(RebelGroups groups, int support) noexcept nogil
cdef void clear_group(RebelGroups groups, Py_ssize_t g) noexcept nogil
cpdef void average(RebelGroups groups, Members members, Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
cdef bint is_paint(RebelGroups groups, Py_ssize_t g, Members members, Situation around) noexcept nogil
cdef double explained(double product, double square) noexcept nogil
cdef bint is_mirrored(RebelGroups groups, Py_ssize_t g, Members members) noexcept nogil
cdef void fit_expansion(RebelGroups groups, Verdicts verdicts) noexcept nogil
cdef bint spreads_less(RebelGroups groups, Py_ssize_t g, double rate, double sigmas) noexcept nogil
cdef bint is_shifted(RebelGroups groups, Py_ssize_t g, Members members) noexcept nogil
@cython.locals(is_doubtful=bint)
cpdef bint is_flat(RebelGroups groups, Py_ssize_t g, Members members, Situation around) noexcept nogil
cdef bint ground_would_flow(EdgeColumns edges, Py_ssize_t i, Situation around) noexcept nogil
@cython.locals(few=bint, flat=bint, stands=bint, inside=bint)
cdef void find_odd(RebelGroups groups, Members members, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cpdef double own_expansion(RebelGroups groups, Py_ssize_t g) noexcept nogil
cdef void gather(RebelGroups groups, EdgeColumns edges, Verdicts verdicts, int[::1] breaking, Py_ssize_t rebels, Baselines baselines, Situation around, Settings settings) noexcept nogil
