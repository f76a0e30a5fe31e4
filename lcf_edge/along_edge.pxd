cimport cython
from libc cimport math

cdef int REACH_PX

@cython.locals(i=cython.Py_ssize_t)
cpdef void measure(const unsigned char[:, :] image, const int[:, ::1] pixel, float[::1] ratio) noexcept nogil

@cython.locals(u=cython.int, v=cython.int, slanting=cython.int, other=cython.int, gx=cython.int, gy=cython.int,
               xx=cython.int, yy=cython.int, xy=cython.int, mean=cython.double, half=cython.double,
               apart=cython.double)
cdef double eigenvalue_ratio(const unsigned char[:, :] image, int x, int y) noexcept nogil
