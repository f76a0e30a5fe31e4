cimport cython
from libc.stdlib cimport abs

cdef int FOURTH

@cython.locals(total=cython.int, grey=cython.int, at=cython.Py_ssize_t, k=cython.Py_ssize_t, x=cython.Py_ssize_t,
               y=cython.Py_ssize_t, across=cython.Py_ssize_t)
cpdef int compare(const unsigned char[::1] image, Py_ssize_t width, Py_ssize_t height, unsigned char[::1] samples,
                  const unsigned char[::1] others) noexcept nogil
@cython.locals(total=cython.int, bright=cython.int, y=cython.Py_ssize_t, at=cython.Py_ssize_t)
cpdef void brightness(const unsigned char[::1] image, Py_ssize_t width, Py_ssize_t height, Py_ssize_t step, int least,
                      int[::1] into) noexcept nogil
@cython.locals(near_sum=cython.longlong, far_sum=cython.longlong, at=cython.Py_ssize_t, line=cython.Py_ssize_t,
               lines=cython.Py_ssize_t)
cpdef double fine_share_of_rows(const unsigned char[::1] image, Py_ssize_t width, Py_ssize_t height, Py_ssize_t first,
                                Py_ssize_t between, Py_ssize_t far) noexcept nogil
@cython.locals(near_sum=cython.longlong, far_sum=cython.longlong, at=cython.Py_ssize_t, y=cython.Py_ssize_t,
               lines=cython.Py_ssize_t)
cpdef double fine_share_of_columns(const unsigned char[::1] image, Py_ssize_t width, Py_ssize_t height,
                                   Py_ssize_t first, Py_ssize_t between, Py_ssize_t far) noexcept nogil
@cython.locals(total=cython.int, k=cython.Py_ssize_t, difference=cython.int)
cdef int squares_along(const unsigned char[::1] image, Py_ssize_t at, Py_ssize_t other, Py_ssize_t count) noexcept nogil
@cython.locals(total=cython.int, difference=cython.int)
cdef int squares_across(const unsigned char[::1] image, Py_ssize_t at, Py_ssize_t other, Py_ssize_t count,
                        Py_ssize_t between) noexcept nogil
cdef double fine_share(long long near_sum, Py_ssize_t near_count, long long far_sum,
                       Py_ssize_t far_count) noexcept nogil
