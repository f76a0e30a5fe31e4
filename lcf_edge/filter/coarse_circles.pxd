cimport cython
from libc cimport math
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport body_ahead, coarse_motion, lengths, situation
from lcf_edge.filter.body_ahead cimport BodyAhead
from lcf_edge.filter.circles cimport Ids, Members
from lcf_edge.filter.coarse_motion cimport CoarseMotion
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef int LINKS
cdef double MIN_S
cdef int MIN_PIECES
cdef int MANY_PIECES
cdef int TOUCHING
cdef int HALF_PIECE
cdef double SPREAD_PX2
cdef int CROSSING
cdef double INFINITY
cdef double NAN

cdef class CoarseGroups:
    cdef int[::1] group, circle, lasting
    cdef Members members
    cdef double[::1] mean_vx, mean_vy, foot
    cdef BodyAhead body

@cython.locals(is_any=bint, linked=bint, k=int)
cdef bint begin(CoarseGroups groups, CoarseMotion coarse) noexcept nogil
@cython.locals(changed=bint, k=int, column=int, row=int, r=int, c=int, other=int)
cdef void join(CoarseGroups groups, CoarseMotion coarse) noexcept nogil
@cython.locals(k=int, g=int, pieces=int, share=double, spread=double)
cdef void gather(CoarseGroups groups, Members members, CoarseMotion coarse, double dt_s) noexcept nogil
@cython.locals(k=int)
cdef void set_cause(CoarseGroups groups, CoarseMotion coarse, int g, CircleColumns circles, int c, Situation around) noexcept nogil
@cython.locals(g=int, c=int, in_the_air=bint, enough=bint)
cdef void update_moving(CoarseGroups groups, CoarseMotion coarse, EdgeColumns edges, CircleColumns circles, unsigned char[::1] updated, Situation around, Settings settings, Ids ids) noexcept nogil
cdef void update(CoarseGroups groups, CoarseMotion coarse, EdgeColumns edges, CircleColumns circles, unsigned char[::1] updated, Situation around, Settings settings, Ids ids) noexcept nogil
