cimport cython

cdef double ALONE_SHARE
cdef int ALONE_GREY
cdef int IMAGES
cdef int MISSED

@cython.locals(kept=cython.int, i=cython.Py_ssize_t, at=cython.int)
cpdef int keep_cool(int[:, ::1] singles, int number, const unsigned char[::1] image, int width, int[:, ::1] pixel,
                    float[::1] strength) noexcept nogil
@cython.locals(row=cython.int, middle=cython.int, beside=cython.int, grey=cython.int, most=cython.int, least=cython.int)
cdef bint stands_alone(const unsigned char[::1] image, int width, int at, double strength) noexcept nogil
@cython.locals(row=cython.int, images=cython.int, current=cython.bint)
cdef bint is_hot(int[:, ::1] singles, int number, int at) noexcept nogil
