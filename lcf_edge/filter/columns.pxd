cimport cython

cdef double OWN_PART_S

@cython.final
cdef class EdgeColumns:
    cdef public Py_ssize_t count, capacity
    cdef double[::1] x, y, beta, speed, bl, trust, deviation, origin_x, origin_y
    cdef double[:, ::1] key_x, key_y
    cdef int[::1] born_key, circle, square, suspect_keys
    cdef unsigned char[::1] rebel, held, matched
    cdef unsigned char[:, ::1] appearance
    cdef unsigned long long[:, ::1] words
    cdef double[::1] predicted_x, predicted_y, predicted_speed, cos, sin, cost
    cdef int[::1] corner, best, psi, fixed_x, fixed_y
    cdef double[::1] fixed_s
    cdef double[::1] variance_along, variance_across, covariance_speed, variance_speed
    cdef bint own_way(self, Py_ssize_t i) noexcept nogil
    cdef bint is_own_part(self, Py_ssize_t i) noexcept nogil
    @cython.locals(number=int)
    cpdef int rebels(self) noexcept nogil
    @cython.locals(number=int)
    cpdef int chains(self) noexcept nogil

@cython.final
cdef class CircleColumns:
    cdef public Py_ssize_t capacity
    cdef public int evicted
    cdef unsigned char[::1] active, cause
    cdef unsigned int[::1] id
    cdef int[::1] support
    cdef double[::1] x, y, radius, beta, speed, expansion, trust, corr, width, height, ttc, range, lateral, unseen_s
    cdef int[::1] square

@cython.final
cdef class ObjectColumns:
    cdef public Py_ssize_t capacity
    cdef unsigned char[::1] active, class_id, state, left, watched
    cdef unsigned char[:, ::1] looks
    cdef unsigned int[::1] id
    cdef int[::1] support
    cdef double[::1] x, y, width, height, looming, sideways, mm, qq, mq, log_odds, foot, trust, age_s, unseen_s
    cdef double[::1] reference, middle, middle_sigma, recent_edges
    cdef double[::1] inverse, inverse_var, steady, steady_speed, steady_var, steady_inverse
    cdef double[::1] ttc, ttc_sigma, range, range_sigma, lateral, lateral_sigma, forward, forward_sigma
    cdef double[::1] right, right_sigma, closest, closest_sigma, probability

@cython.final
cdef class PsiColumns:
    cdef public Py_ssize_t capacity
    cdef Py_ssize_t live_count
    cdef unsigned char[::1] active, shape
    cdef unsigned int[::1] id
    cdef double[::1] x, y, width, height, trust, expansion, life_s
    cdef int[::1] circle, edges, missing, new, live

cdef class GroupColumns:
    cdef public Py_ssize_t count, capacity
    cdef double[::1] x, y, bs, trust
    cdef int[::1] row

cdef class CornerColumns:
    cdef public Py_ssize_t count
    cdef double[::1] x, y, cost
    cdef int[::1] pixel_x, pixel_y, edge, psi
    cdef unsigned long long[:, ::1] words
    cdef unsigned char[::1] omitted, free, taken, expected
