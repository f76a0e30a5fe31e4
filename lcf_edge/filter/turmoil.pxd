cimport cython
from libc cimport math
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport coarse_motion, edge_equations, lengths, rounding, situation
from lcf_edge.filter.circles cimport Ids, Members
from lcf_edge.filter.coarse_motion cimport CoarseMotion
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef int ACROSS
cdef double HALF_LIFE_S
cdef double MIN_EDGES
cdef double MIN_LOST
cdef double FOUND_SHARE
cdef double FOUND_NOW_SHARE
cdef double FOUND_ELSEWHERE
cdef double LOST_STILL_SHARE
cdef double MIN_HIDDEN
cdef double BLIND_SHARE
cdef double HIDDEN_FOUND_SHARE
cdef int MIN_HIDDEN_CELLS
cdef double MIN_HIDDEN_S
cdef int MIN_CELLS
cdef double CHANGED_SHARE
cdef double MIN_S
cdef double MET_S
cdef double SLOW_MPS
cdef int NONE
cdef double INFINITY

cdef class Turmoil:
    cdef readonly int across, down
    cdef readonly double side_px
    cdef double per_px
    cdef readonly double[::1] found, lost, longest_s
    cdef double[::1] standing, changed, all_standing, all_changed
    cdef double[::1] found_now, lost_now, trusted_now, hidden_now, lasts_s, weight
    cdef unsigned char[::1] unruly, hidden
    cdef readonly int[::1] place, size
    cdef int[::1] hidden_size
    cdef readonly Members members

cdef int cell_at(Turmoil turmoil, double x, double y) noexcept nogil
cdef double middle_x(Turmoil turmoil, int k) noexcept nogil
cdef double middle_y(Turmoil turmoil, int k) noexcept nogil
@cython.locals(k=int, trusted=int)
cpdef void count(Turmoil turmoil, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
@cython.locals(p=int, k=int)
cdef void count_pieces(Turmoil turmoil, CoarseMotion coarse) noexcept nogil
cpdef bint is_all_lost(Turmoil turmoil, bint before) noexcept nogil
cdef bint is_inner(Turmoil turmoil, int k) noexcept nogil
@cython.locals(total=double, row=int, middle=int)
cdef double with_those_around(double[::1] values, Turmoil turmoil, int k) noexcept nogil
@cython.locals(ground_m=double)
cdef double stays_px(Turmoil turmoil, int k, Situation around) noexcept nogil
cdef bint is_unruly(Turmoil turmoil, int k, Situation around, Settings settings) noexcept nogil
@cython.locals(hidden=double)
cdef bint is_hidden(Turmoil turmoil, int k) noexcept nogil
@cython.locals(row=int, column=int)
cdef void mark(Turmoil turmoil, int k) noexcept nogil
cdef bint is_found_elsewhere(Turmoil turmoil) noexcept nogil
@cython.locals(is_any=bint)
cdef bint see(Turmoil turmoil, Situation around, Settings settings) noexcept nogil
@cython.locals(changed=bint, x=int, y=int, k=int, other=int)
cdef void join_cells(Turmoil turmoil) noexcept nogil
@cython.locals(k=int, g=int)
cdef void gather(Turmoil turmoil) noexcept nogil
@cython.locals(longest_s=cython.double)
cdef bint is_believed(Turmoil turmoil, int g, Situation around) noexcept nogil
@cython.locals(nearest=int, least=double, meets=bint)
cdef int circle_of(Turmoil turmoil, Py_ssize_t g, CircleColumns circles, Settings settings) noexcept nogil
cdef bint looks_changed(Turmoil turmoil, int g) noexcept nogil
cdef bint is_shown_by(CircleColumns circles, Py_ssize_t c) noexcept nogil
cdef void set_cause(CircleColumns circles, Py_ssize_t c, Situation around) noexcept nogil
@cython.locals(k=int, found=double, lost=double)
cdef bint rages_on(Turmoil turmoil, CircleColumns circles, Py_ssize_t c) noexcept nogil
@cython.locals(c=int, seen=bint)
cdef void update(Turmoil turmoil, EdgeColumns edges, CircleColumns circles, unsigned char[::1] updated, CoarseMotion coarse, Situation around, Settings settings, Ids ids) noexcept nogil
