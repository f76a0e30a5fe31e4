cimport cython
from libc cimport math

cdef int MAX_UNKNOWNS
cdef double MIN_PIVOT

cdef class NormalEquations:
    cdef int unknowns
    cdef readonly double[::1] row, right, solution
    cdef readonly double[:, ::1] matrix, inverse
    cdef double[:, ::1] factor

cpdef void begin(NormalEquations equations, int unknowns) noexcept nogil
cpdef void add_prior(NormalEquations equations, Py_ssize_t i, double weight) noexcept nogil
cpdef void add(NormalEquations equations, double weight, double measured) noexcept nogil
@cython.locals(rest=double, i=int, j=int, k=int)
cdef void factorise(NormalEquations equations) noexcept nogil
@cython.locals(rest=double, last=int, i=int, j=int, k=int)
cdef void substitute(NormalEquations equations) noexcept nogil
cpdef void solve(NormalEquations equations) noexcept nogil
cpdef void invert(NormalEquations equations) noexcept nogil
