cimport cython
from libc cimport math
from lcf_edge.filter.columns cimport ObjectColumns

cdef double STEADY_MPS
cdef double SUDDEN_SIGMAS
cdef double FIRST_SHARE
cdef double LEAST_SHARE

cdef void forget(ObjectColumns objects, Py_ssize_t o) noexcept nogil
@cython.locals(squared=double, wander=double)
cdef void predict(ObjectColumns objects, Py_ssize_t o, double growth, double dt_s) noexcept nogil
cdef void begin(ObjectColumns objects, Py_ssize_t o, double rate, double variance, double speed_mps) noexcept nogil
@cython.locals(first=double, gained_mps=double, news=double, total=double, gain=double, gain_inverse=double, least=double)
cpdef void observe(ObjectColumns objects, Py_ssize_t o, double rate, double variance, double speed_mps) noexcept nogil
