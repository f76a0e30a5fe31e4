cimport cython

cdef int MEAN_GREY

@cython.locals(i=cython.Py_ssize_t, k=cython.Py_ssize_t, at=cython.Py_ssize_t, total=cython.int, shift=cython.int,
               grey=cython.int)
cpdef void sample(const unsigned char[::1] smooth, const int[:, ::1] pixel, const Py_ssize_t[::1] ring, Py_ssize_t width,
                  unsigned char[:, ::1] samples) noexcept nogil
