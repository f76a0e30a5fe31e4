cimport cython
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport lengths
from lcf_edge.filter.circles cimport Ids, Members
from lcf_edge.filter.coarse_motion cimport CoarseMotion
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double SAME_TIME
cdef double SAME_CONTACT
cdef int MIN_PIECES
cdef double MIN_SHARE
cdef int MIN_SIDE
cdef double GROWTH
cdef double MIN_SPREAD
cdef double MIN_CONTACT_S
cdef double UPRIGHT
cdef double BESIDE_PX
cdef double SPREAD_PX2
cdef int INCOMING
cdef double INFINITY

cdef class BodyAhead:
    cdef unsigned char[::1] is_part
    cdef Members members
    cdef double rate, highest, lowest, across, down
    cdef int left, right

cdef bint is_met_with(CoarseMotion coarse, int k, int other) noexcept nogil
@cython.locals(pieces=int, middle=int, most=int, k=int, met=int, other=int)
cdef int middle_piece(CoarseMotion coarse) noexcept nogil
@cython.locals(middle=int, near=int, k=int)
cdef bint gather(BodyAhead body, Members members, CoarseMotion coarse) noexcept nogil
@cython.locals(share=double, beside_px=double, k=int, wide=double, tall=double, parting=double, growing=double, dx=double, dy=double, least=double)
cdef void measure(BodyAhead body, Members members, CoarseMotion coarse, Situation around) noexcept nogil
@cython.locals(least=double)
cdef bint comes_closer(BodyAhead body, CoarseMotion coarse, Situation around) noexcept nogil
@cython.locals(nearest=int, least=double, c=int, away=double)
cdef int circle_of(BodyAhead body, Members members, CircleColumns circles, unsigned char[::1] updated, Settings settings) noexcept nogil
@cython.locals(c=int, k=int)
cdef void update(BodyAhead body, Members members, CoarseMotion coarse, int[::1] circle, EdgeColumns edges, CircleColumns circles, unsigned char[::1] updated, Situation around, Settings settings, Ids ids) noexcept nogil
