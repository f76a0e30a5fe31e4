cimport cython
from libc cimport math
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport coarse_circles, edge_equations, flow, image_plane, lengths, patch_circles, path, rebel_detection, situation, turmoil
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.circles cimport Ids, Members
from lcf_edge.filter.coarse_circles cimport CoarseGroups
from lcf_edge.filter.coarse_motion cimport CoarseMotion
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.patch_circles cimport PatchGroups
from lcf_edge.filter.patches cimport Patches
from lcf_edge.filter.rebel_detection cimport Verdicts
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation
from lcf_edge.filter.turmoil cimport Turmoil

cdef double VELOCITY_NOISE_PX
cdef double STILL_PX
cdef double LIKE_SPEED
cdef double SIDEWAYS
cdef double MIN_RANGE_M
cdef double MIN_RATE
cdef double RATE_SIGMAS
cdef double MAX_GROWTH
cdef double MAX_EXCESS
cdef double MIN_SHOWN_PX
cdef double LEADER_HEIGHT_SHARE
cdef double MIRROR_NOISE_PX
cdef double MIRROR_SIGMAS
cdef double SURE_REBELS
cdef double MOVER_SHARE
cdef double LIKELY_OWN_S
cdef double SEEN_TO_MOVE_PX
cdef double OWN_SHARE
cdef double SPREAD_NOISE_PX
cdef int STRAY_ROUNDS
cdef double STRAY_SIGMAS
cdef double STRAY_SHARE
cdef double SPREAD_SIGMAS
cdef double SPREAD_SHARE
cdef double MAX_RANGE_M
cdef double MAX_TTC_HORIZONS
cdef double MIN_EXTENT2_PX
cdef double FASTEST_EXPANSION
cdef double LINK_SHARE
cdef double FAR_LINK_SHARE
cdef double FAR_LINK_RAD
cdef double NEAR_LINK_M
cdef double NEAR_LIKE_HZ
cdef double STAND_SHARE
cdef double FAR_LIKE_SPEED
cdef double COAST_SHARE
cdef double COAST_TIME_SHARE
cdef double MIN_TTC_SHARE
cdef double BLIND_S
cdef double MAX_TURN_RAD
cdef int CROSSING
cdef int INCOMING
cdef int LEADING
cdef double INFINITY
cdef double NAN

cdef class RebelGroups:
    cdef public Py_ssize_t count, groups
    cdef readonly int[::1] verdict, label
    cdef int[::1] group
    cdef readonly double[::1] vx, vy, elapsed_s, inverse
    cdef readonly Members members
    cdef readonly double[::1] mean_s, closing_mps, focus_rate, focus_r2
    cdef double[::1] mean_vx, mean_vy, below2, below_vy
    cdef readonly double[::1] then_x, then_y, spread
    cdef double[::1] rate_below, r2_below2, spreading
    cdef readonly double[::1] expansion
    cdef double[::1] weight, weighed_rate, left, right, top, bottom
    cdef readonly int[::1] standing, inwards, flowing, circle
    cdef int[::1] best_circle, best_group
    cdef int[:, ::1] votes
    cdef unsigned char[::1] odd, updated, missed

cpdef void predict(CircleColumns circles, Situation around) noexcept nogil
cdef bint coasts(CircleColumns circles, Py_ssize_t c, Situation around, Settings settings) noexcept nogil
@cython.locals(near=bint)
cpdef void end_outside(CircleColumns circles, ImagePlane plane, Situation around, Settings settings) noexcept nogil
cdef int circle_at(CircleColumns circles, double x, double y, Settings settings) noexcept nogil
cdef double looming_rate(CircleColumns circles, Py_ssize_t c, double horizon_s) noexcept nogil
cdef double velocity_x(CircleColumns circles, Py_ssize_t c, double x, double horizon_s) noexcept nogil
cdef double velocity_y(CircleColumns circles, Py_ssize_t c, double y, double horizon_s) noexcept nogil
cpdef void take_rebels(RebelGroups groups, Py_ssize_t rebels, int[::1] breaking, Verdicts verdicts, EdgeColumns edges, Baselines baselines) noexcept nogil
cdef double noise_between(RebelGroups groups, Py_ssize_t a, Py_ssize_t b) noexcept nogil
cdef bint are_linked(RebelGroups groups, Py_ssize_t a, Py_ssize_t b, double distance, Situation around, Settings settings) noexcept nogil
cdef bint stand_together(RebelGroups groups, Py_ssize_t a, Py_ssize_t b, double distance, Situation around) noexcept nogil
cpdef int lowest_label(RebelGroups groups, int k) noexcept nogil
cdef void join(RebelGroups groups, int a, int b) noexcept nogil
cpdef void cluster(RebelGroups groups, Verdicts verdicts, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cdef double near_link_px(double y, Situation around) noexcept nogil
cdef void join_near(RebelGroups groups, Verdicts verdicts, EdgeColumns edges, Situation around, int support) noexcept nogil
cdef void measure_sizes(RebelGroups groups) noexcept nogil
cpdef void number_groups(RebelGroups groups, int support) noexcept nogil
cdef void clear_group(RebelGroups groups, Py_ssize_t g) noexcept nogil
cpdef void average(RebelGroups groups, Members members, Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
cdef bint is_paint(RebelGroups groups, Py_ssize_t g, Members members, Situation around) noexcept nogil
cdef bint is_mirrored(RebelGroups groups, Py_ssize_t g, Members members) noexcept nogil
cdef void fit_expansion(RebelGroups groups, Verdicts verdicts) noexcept nogil
cdef bint spreads_less(RebelGroups groups, Py_ssize_t g, double rate) noexcept nogil
cdef bint is_shifted(RebelGroups groups, Py_ssize_t g, Members members) noexcept nogil
cpdef bint is_flat(RebelGroups groups, Py_ssize_t g, Members members, Situation around) noexcept nogil
cdef bint ground_would_flow(EdgeColumns edges, Py_ssize_t i, Situation around) noexcept nogil
@cython.locals(few=bint, flat=bint, stands=bint, inside=bint)
cdef void find_odd(RebelGroups groups, Members members, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
@cython.locals(inside=bint)
cdef void vote(RebelGroups groups, Verdicts verdicts, EdgeColumns edges, CircleColumns circles, Settings settings) noexcept nogil
cdef void choose(RebelGroups groups, CircleColumns circles) noexcept nogil
cdef void involve(RebelGroups groups, Verdicts verdicts, EdgeColumns edges, CircleColumns circles, Settings settings) noexcept nogil
cdef bint is_aligned(RebelGroups groups, Py_ssize_t g, CircleColumns circles, Py_ssize_t c, Situation around, Settings settings) noexcept nogil
cpdef double bounded(double size_px, double shown_px) noexcept nogil
cdef void meet(RebelGroups groups, Py_ssize_t g, CircleColumns circles, Situation around, Settings settings) noexcept nogil
cdef int largest_new(RebelGroups groups) noexcept nogil
cdef void found(RebelGroups groups, EdgeColumns edges, CircleColumns circles, Settings settings, Ids ids) noexcept nogil
cpdef double own_expansion(RebelGroups groups, Py_ssize_t g) noexcept nogil
cdef double expansion_of(RebelGroups groups, Py_ssize_t g, bint stands, double range_m, Situation around) noexcept nogil
@cython.locals(stands=bint)
cdef void contact(RebelGroups groups, Py_ssize_t g, CircleColumns circles, Situation around, Settings settings) noexcept nogil
cdef double finite(double value) noexcept nogil
@cython.locals(beside=bint, crosses=bint)
cdef int cause_of(RebelGroups groups, Py_ssize_t g, CircleColumns circles, bint stands, double aside_mps, Situation around) noexcept nogil
@cython.locals(across=bint)
cdef bint is_hidden(CircleColumns circles, Py_ssize_t c, Settings settings) noexcept nogil
@cython.locals(near=bint, waits=bint)
cdef void lose_trust(RebelGroups groups, CircleColumns circles, Situation around, Settings settings) noexcept nogil
cpdef void update(RebelGroups groups, EdgeColumns edges, CircleColumns circles, Verdicts verdicts, int[::1] breaking, Py_ssize_t rebels, Patches patches, PatchGroups patch_groups, Turmoil disorder, CoarseMotion coarse, CoarseGroups coarse_groups, Baselines baselines, Situation around, Settings settings, Ids ids) noexcept nogil
