cimport cython
from libc.stdlib cimport abs

cdef int MEAN_GREY
cdef int NOISE
cdef double ALIKE_SHARE
cdef int LEAVES

cdef class Squares:
    cdef readonly int side_px, rows, columns
    cdef readonly int[::1] begin
    cdef readonly unsigned char[::1] poor
    cdef readonly int[:, ::1] rectangles

@cython.locals(s=cython.int)
cdef void move(int[:, ::1] pixel, float[::1] strength, unsigned char[:, ::1] samples, Py_ssize_t i,
               Py_ssize_t to) noexcept nogil
@cython.locals(kept=cython.int)
cpdef int keep_distinct(int[:, ::1] pixel, float[::1] strength, unsigned char[:, ::1] samples,
                        unsigned char[::1] beaten, int reach) noexcept nogil
@cython.locals(differences=cython.int, one=cython.int, other=cython.int, s=cython.int)
cdef bint look_alike(unsigned char[:, ::1] samples, Py_ssize_t i, Py_ssize_t k) noexcept nogil
cdef void count(Squares squares, const int[:, ::1] pixel, int[::1] square) noexcept nogil
cdef void gather(Squares squares, const int[::1] square, int[::1] listed) noexcept nogil
cdef int place_in_square(Squares squares, int s, int i, const float[::1] strength, const int[::1] listed,
                         int enough) noexcept nogil
@cython.locals(last=cython.int, fit=cython.int, room=cython.int, rivals=cython.int, stronger=cython.int, kept=cython.int,
               more=bint)
cpdef void keep_spread(Squares squares, const int[:, ::1] pixel, const float[::1] strength, int[::1] listed,
                       int[::1] place, int capacity) noexcept nogil
@cython.locals(leaves=bint)
cpdef int keep_strongest(Squares squares, int[:, ::1] pixel, float[::1] strength, unsigned char[:, ::1] samples,
                         int[::1] listed, int[::1] square, int share) noexcept nogil
cpdef int find_poor(Squares squares, const int[:, ::1] pixel, int[::1] square, int few,
                    const unsigned char[:, ::1] among, int first_row) noexcept nogil
@cython.locals(below=bint)
cdef int add_rectangle(Squares squares, int found, int left, int right, int row) noexcept nogil
cpdef int leave_poor(Squares squares, int[:, ::1] pixel, float[::1] strength, unsigned char[:, ::1] samples,
                     const int[::1] square) noexcept nogil
