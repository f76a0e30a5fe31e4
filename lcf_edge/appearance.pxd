cimport cython

cdef int MEAN_GREY

@cython.locals(i=cython.Py_ssize_t, k=cython.Py_ssize_t, count=cython.Py_ssize_t, x=cython.int, y=cython.int,
               total=cython.int, shift=cython.int, grey=cython.int)
cpdef void sample(const unsigned char[:, :] image, const int[:, ::1] pixel, const int[:, ::1] ring,
                  unsigned char[:, ::1] samples) noexcept nogil
