cimport cython
from libc cimport math
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport lengths, path, situation
from lcf_edge.filter.circles cimport Ids, Members
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns
from lcf_edge.filter.patches cimport Patches
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double MIN_ELAPSED_S
cdef double MIN_SIGMAS
cdef double ALIKE_SIGMAS
cdef double UNEVEN
cdef double SLOWER_HORIZONS
cdef double KNOWN_WIDTHS
cdef double HALF_SHARE
cdef double GROUND_MARGIN
cdef double UPRIGHT_SHARE
cdef double UPRIGHT_SIGMAS
cdef double LOWEST_SHARE
cdef double DRIFT_RAD
cdef double PITCH_RAD
cdef double DRIFT_PX
cdef double AGREE_SIGMAS
cdef double AGREE_SHARE
cdef double AGREE_AT_MOST
cdef double SIDE_SIDES
cdef double STACK_SIDES
cdef int INCOMING
cdef double INFINITY

cdef class PatchGroups:
    cdef readonly unsigned char[::1] obstacle, taken
    cdef readonly Members members
    cdef double left, top, right, bottom, weight, inverse, uneven

cdef bint stands(Patches patches, Py_ssize_t p, Situation around) noexcept nogil
cdef bint is_obstacle(Patches patches, Py_ssize_t p, Situation around) noexcept nogil
cdef bint is_upright(Patches patches, Py_ssize_t p, Situation around) noexcept nogil
cdef bint is_in_way(PatchGroups groups, Py_ssize_t g, Patches patches, bint is_known, Situation around) noexcept nogil
cdef bint agree(Patches patches, Py_ssize_t p, Py_ssize_t q) noexcept nogil
cdef void add(PatchGroups groups, Py_ssize_t g, Patches patches, Py_ssize_t p) noexcept nogil
cdef void gather(PatchGroups groups, Py_ssize_t p, Patches patches) noexcept nogil
cdef bint grows_evenly(PatchGroups groups) noexcept nogil
cdef void claim(PatchGroups groups, Py_ssize_t p, Patches patches, int circle) noexcept nogil
@cython.locals(nearest=int, least=double)
cdef int circle_of(PatchGroups groups, Py_ssize_t g, CircleColumns circles, Settings settings) noexcept nogil
cdef bint continues(PatchGroups groups, CircleColumns circles, Py_ssize_t c, Situation around) noexcept nogil
@cython.locals(seen=bint, is_shown=bint, is_known=bint, c=int)
cdef void update(PatchGroups groups, Patches patches, EdgeColumns edges, CircleColumns circles, unsigned char[::1] updated, Situation around, Settings settings, Ids ids) noexcept nogil
