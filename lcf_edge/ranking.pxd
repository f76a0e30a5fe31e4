cimport cython

@cython.locals(i=cython.Py_ssize_t, k=cython.Py_ssize_t, s=cython.Py_ssize_t, count=cython.Py_ssize_t, here=cython.int,
               other=cython.int)
cpdef void rank(const int[:, ::1] pixel, const float[::1] strength, int side_px, int columns, int[::1] square,
                int[::1] first, int[::1] held, Py_ssize_t[::1] place) noexcept nogil
