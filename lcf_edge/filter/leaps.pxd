cimport cython
from libc.stdlib cimport abs
from lcf_edge.filter cimport image_plane, matching, rounding
from lcf_edge.filter.columns cimport CornerColumns, EdgeColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.matching cimport CornerIndex
from lcf_edge.filter.settings cimport Settings

cdef int COLUMNS
cdef int ROWS
cdef double REACH_SHARE
cdef int BINS
cdef int SIDE
cdef int MIN_LOST
cdef double LOST_SHARE
cdef int MIN_VOTES
cdef double AGREEING_SHARE
cdef double RIVAL_SHARE
cdef int MAX_ASKING

cdef class Leaps:
    cdef readonly int[::1] part, rows, seen, lost
    cdef int[::1] votes, voter, shifts
    cdef readonly double[::1] u, v
    cdef public int count, across
    cdef int down, asking, most

cdef void ask(Leaps leaps, ImagePlane plane, EdgeColumns edges) noexcept nogil
cdef bint is_lost(Leaps leaps, int part) noexcept nogil
@cython.locals(count=int)
cdef int list_far(CornerIndex index, CornerColumns corners, double u, double v, double reach, double near_px) noexcept nogil
@cython.locals(i=int, across=int, down=int, a=int, b=int)
cdef void vote(Leaps leaps, CornerIndex index, EdgeColumns edges, int k, CornerColumns corners, double reach, Settings settings) noexcept nogil
cdef void add_vote(Leaps leaps, int shift, int i) noexcept nogil
@cython.locals(best=int, shift=int, votes=int)
cdef void most_votes(Leaps leaps) noexcept nogil
@cython.locals(near=bint, rival=int, shift=int)
cdef int rival_votes(Leaps leaps) noexcept nogil
cdef void forget(Leaps leaps) noexcept nogil
@cython.locals(best=int, i=int)
cdef int take(Leaps leaps, CornerIndex index, EdgeColumns edges, int k, CornerColumns corners, double reach, Settings settings) noexcept nogil
@cython.locals(agree=bint, part=int, asked=int, i=int)
cpdef int find(Leaps leaps, CornerIndex index, ImagePlane plane, EdgeColumns edges, CornerColumns corners, Settings settings) noexcept nogil
