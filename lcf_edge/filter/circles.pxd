cimport cython
from libc cimport math
from lcf_edge.filter cimport edge_equations, lengths, path
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double RADIUS_SIGMAS
cdef double MIN_RADIUS_PX
cdef double EXTENT_SIGMAS
cdef double TRUST_A_FRAME
cdef double MIN_RANGE_M
cdef unsigned long long LAST_ID
cdef int INCOMING
cdef double INFINITY
cdef double NAN

cdef class Ids:
    cdef public unsigned long long next

cdef class Members:
    cdef public Py_ssize_t capacity
    cdef readonly int[::1] size
    cdef readonly double[::1] x, y, variance_y
    cdef double[::1] variance_x

cdef unsigned int new_id(Ids ids) noexcept nogil
cdef void clear(Members members, Py_ssize_t g) noexcept nogil
cdef double radius_of(Members members, Py_ssize_t g, double max_px) noexcept nogil
cdef void blend(CircleColumns circles, Py_ssize_t c, Members members, Py_ssize_t g, Settings settings) noexcept nogil
cdef void confirm(CircleColumns circles, Py_ssize_t c, Members members, Py_ssize_t g, Settings settings) noexcept nogil
@cython.locals(left_s=double, trust=double)
cdef double contact_rate(CircleColumns circles, Py_ssize_t c, double rate, double dt_s, Settings settings) noexcept nogil
@cython.locals(right_m=double, rate=double, dx=double, dy=double)
cdef void stand(CircleColumns circles, Py_ssize_t c, double x, double range_m, Situation around, Settings settings) noexcept nogil
cdef void describe(CircleColumns circles, Py_ssize_t c, Members members, Py_ssize_t g) noexcept nogil
cdef void give_birth(CircleColumns circles, Py_ssize_t c, Members members, Py_ssize_t g, Settings settings, Ids ids) noexcept nogil
cdef void begin(CircleColumns circles, Py_ssize_t c, Ids ids) noexcept nogil
@cython.locals(nearest=int, least=double, away=double)
cdef int nearest_circle(Members members, Py_ssize_t g, CircleColumns circles, Settings settings) noexcept nogil
cdef int free_row(CircleColumns circles) noexcept nogil
cdef int weakest_row(CircleColumns circles, Settings settings) noexcept nogil
cdef void release(EdgeColumns edges, CircleColumns circles, bint rebel) noexcept nogil
cdef int make_room(EdgeColumns edges, CircleColumns circles, bint rebel, Settings settings) noexcept nogil
@cython.locals(c=int)
cpdef int row_for_newborn(EdgeColumns edges, CircleColumns circles, bint rebel, Settings settings) noexcept nogil
