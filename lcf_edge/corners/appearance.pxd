cimport cython
from libc.stdlib cimport abs

cdef int MEAN_GREY
cdef int NOISE
cdef double ALIKE_SHARE

@cython.locals(above=cython.Py_ssize_t, below=cython.Py_ssize_t, total=cython.int,
               mean=cython.int)
cdef int mean_around(const unsigned char[::1] image, Py_ssize_t width, Py_ssize_t at) noexcept nogil
@cython.locals(i=cython.Py_ssize_t, k=cython.Py_ssize_t, at=cython.Py_ssize_t, total=cython.int, shift=cython.short,
               grey=cython.short)
cdef void sample(const unsigned char[::1] image, Py_ssize_t width, const int[:, ::1] pixel, const Py_ssize_t[::1] ring,
                  unsigned char[:, ::1] samples) noexcept nogil
@cython.locals(differences=cython.int, one=cython.int, other=cython.int, s=cython.int)
cdef bint look_alike(const unsigned char[:, ::1] samples, Py_ssize_t i, Py_ssize_t k) noexcept nogil
