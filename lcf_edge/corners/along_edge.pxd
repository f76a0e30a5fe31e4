cimport cython
from libc cimport math

cdef int REACH_PX

cpdef int keep_round(const unsigned char[::1] image, Py_ssize_t width, int[:, ::1] pixel, float[::1] strength,
                     double least) noexcept nogil
@cython.locals(k=cython.Py_ssize_t, v=cython.int, above=cython.int, below=cython.int, gx=cython.int, gy=cython.int,
               smooth_before=cython.int, smooth=cython.int, smooth_after=cython.int, slope_before=cython.int,
               slope=cython.int, slope_after=cython.int, xx=cython.int, yy=cython.int, xy=cython.int,
               start=cython.Py_ssize_t, mean=cython.double, half=cython.double, apart=cython.double)
cpdef double roundness(const unsigned char[::1] image, Py_ssize_t width, int x, int y) noexcept nogil
