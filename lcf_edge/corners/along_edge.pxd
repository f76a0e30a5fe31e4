cimport cython
from libc cimport math

cdef int REACH_PX

cpdef int keep_round(const unsigned char[::1] image, Py_ssize_t width, const short[::1] within, int[:, ::1] pixel,
                     float[::1] strength, double least) noexcept nogil
@cython.locals(k=cython.Py_ssize_t, v=cython.int, at=cython.Py_ssize_t, above=cython.Py_ssize_t,
               below=cython.Py_ssize_t, before=cython.short, after=cython.short, upper=cython.short,
               lower=cython.short, gx=cython.short, gy=cython.short, xx=cython.int, yy=cython.int, xy=cython.int,
               mean=cython.double, half=cython.double, apart=cython.double)
cpdef double roundness(const unsigned char[::1] image, Py_ssize_t width, const short[::1] within, int x,
                       int y) noexcept nogil
