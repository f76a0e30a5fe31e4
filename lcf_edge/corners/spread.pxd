cimport cython
from libc.stdlib cimport abs
from lcf_edge.corners cimport appearance
from lcf_edge.filter cimport rounding

cdef int LEVELS
cdef int LEAVES

cdef class Squares:
    cdef readonly int side_px, rows, columns
    cdef int[::1] row_of, counted, ends
    cdef readonly unsigned char[::1] poor
    cdef readonly int[:, ::1] rectangles

@cython.locals(kept=cython.int, across=cython.int, down=cython.int)
cpdef int keep_distinct(int[:, ::1] pixel, float[::1] strength, const unsigned char[:, ::1] samples,
                        unsigned long long[:, ::1] words, unsigned char[::1] beaten, int reach) noexcept nogil
@cython.locals(s=cython.int)
cdef void count(Squares squares, const int[:, ::1] pixel, int[::1] square) noexcept nogil
@cython.locals(level=cython.int)
cdef void order_by_strength(Squares squares, const float[::1] strength, int[::1] order) noexcept nogil
@cython.locals(last=cython.int, fit=cython.int, room=cython.int, kept=cython.int, s=cython.int, i=cython.int)
cpdef void keep_spread(Squares squares, const int[:, ::1] pixel, const float[::1] strength, int[::1] order,
                       int[::1] place, int capacity) noexcept nogil
@cython.locals(s=cython.int, i=cython.Py_ssize_t)
cpdef int keep_strongest(Squares squares, int[:, ::1] pixel, float[::1] strength, unsigned long long[:, ::1] words,
                         int[::1] order, int[::1] square, const int[::1] share) noexcept nogil
cpdef int find_poor(Squares squares, const int[:, ::1] pixel, int[::1] square, const int[::1] few,
                    const unsigned char[:, ::1] among) noexcept nogil
@cython.locals(below=bint)
cdef int add_rectangle(Squares squares, int found, int left, int right, int row) noexcept nogil
cpdef int leave_poor(Squares squares, int[:, ::1] pixel, float[::1] strength, unsigned long long[:, ::1] words,
                     const int[::1] square) noexcept nogil
