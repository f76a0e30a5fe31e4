cimport cython
from libc cimport math
from lcf_edge.filter.columns cimport EdgeColumns

cdef int KEYS

cdef class KeyFrames:
    cdef readonly double[:, :, ::1] rotation, step
    cdef readonly double[:, ::1] displacement
    cdef readonly double[::1] elapsed_s, sigma_rad
    cdef public int number
    cdef double since_s
    cdef double rate_sigma_radps

cdef void turn_one(KeyFrames keys, Py_ssize_t k, const double[:, :, ::1] rotation) noexcept nogil
cdef void learn(KeyFrames keys, int k, double x, double y, double z, double sigma_rad) noexcept nogil
cpdef void turn(KeyFrames keys, const double[:, :, ::1] rotation) noexcept nogil
cpdef void advance(KeyFrames keys, const double[:, :, ::1] rotation, double ahead_x, double ahead_y, double ahead_z, double way_m, double dt_s) noexcept nogil
cpdef void inflate(KeyFrames keys, double sigma_rad, double dt_s) noexcept nogil
cpdef void scale(KeyFrames keys, double factor) noexcept nogil
cpdef int mark(KeyFrames keys) noexcept nogil
cdef int oldest_key(EdgeColumns edges, Py_ssize_t i, KeyFrames keys) noexcept nogil
cdef bint has_history(EdgeColumns edges, Py_ssize_t i, KeyFrames keys, double min_s) noexcept nogil
