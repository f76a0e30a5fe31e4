cimport cython
from libc cimport math
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport coarse_circles, edge_equations, flow, image_plane, lengths, patch_circles, path, rebel_groups, situation, turmoil
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.circles cimport Ids
from lcf_edge.filter.coarse_circles cimport CoarseGroups
from lcf_edge.filter.coarse_motion cimport CoarseMotion
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.patch_circles cimport PatchGroups
from lcf_edge.filter.patches cimport Patches
from lcf_edge.filter.rebel_detection cimport Verdicts
from lcf_edge.filter.rebel_groups cimport RebelGroups
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation
from lcf_edge.filter.turmoil cimport Turmoil

cdef double STILL_PX
cdef double SIDEWAYS
cdef double MIN_RANGE_M
cdef double MIN_RATE
cdef double MAX_GROWTH
cdef double MAX_EXCESS
cdef double MIN_SHOWN_PX
cdef double SURE_REBELS
cdef double MAX_RANGE_M
cdef double MAX_TTC_HORIZONS
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

cpdef void predict(CircleColumns circles, Situation around) noexcept nogil
cdef bint coasts(CircleColumns circles, Py_ssize_t c, Situation around, Settings settings) noexcept nogil
@cython.locals(near=bint)
cpdef void end_outside(CircleColumns circles, ImagePlane plane, Situation around, Settings settings) noexcept nogil
cdef int circle_at(CircleColumns circles, double x, double y, Settings settings) noexcept nogil
cdef double looming_rate(CircleColumns circles, Py_ssize_t c, double horizon_s) noexcept nogil
cdef double velocity_x(CircleColumns circles, Py_ssize_t c, double x, double horizon_s) noexcept nogil
cdef double velocity_y(CircleColumns circles, Py_ssize_t c, double y, double horizon_s) noexcept nogil
@cython.locals(inside=bint)
cdef void vote(RebelGroups groups, Verdicts verdicts, EdgeColumns edges, CircleColumns circles, Settings settings) noexcept nogil
cdef void choose(RebelGroups groups, CircleColumns circles) noexcept nogil
cdef void involve(RebelGroups groups, Verdicts verdicts, EdgeColumns edges, CircleColumns circles, Settings settings) noexcept nogil
cdef bint is_aligned(RebelGroups groups, Py_ssize_t g, CircleColumns circles, Py_ssize_t c, Situation around, Settings settings) noexcept nogil
cpdef double bounded(double size_px, double shown_px) noexcept nogil
cdef void meet(RebelGroups groups, Py_ssize_t g, CircleColumns circles, Situation around, Settings settings) noexcept nogil
cdef int largest_new(RebelGroups groups) noexcept nogil
cdef void found(RebelGroups groups, EdgeColumns edges, CircleColumns circles, Settings settings, Ids ids) noexcept nogil
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
