cimport cython
from libc.stdlib cimport abs
from lcf_edge.filter cimport rounding

cdef int MEAN_GREY
cdef int NOISE
cdef double ALIKE_SHARE
cdef int LEVELS
cdef int LEAVES

cdef class Squares:
    cdef readonly int side_px, rows, columns
    cdef int[::1] row_of, counted, ends
    cdef readonly unsigned char[::1] poor
    cdef readonly int[:, ::1] rectangles

@cython.locals(s=cython.int)
cdef void move(int[:, ::1] pixel, float[::1] strength, unsigned char[:, ::1] samples, Py_ssize_t i,
               Py_ssize_t to) noexcept nogil
@cython.locals(kept=cython.int, across=cython.int, down=cython.int)
cpdef int keep_distinct(int[:, ::1] pixel, float[::1] strength, unsigned char[:, ::1] samples,
                        unsigned char[::1] beaten, int reach) noexcept nogil
@cython.locals(differences=cython.int, one=cython.int, other=cython.int, s=cython.int)
cdef bint look_alike(unsigned char[:, ::1] samples, Py_ssize_t i, Py_ssize_t k) noexcept nogil
@cython.locals(s=cython.int)
cdef void count(Squares squares, const int[:, ::1] pixel, int[::1] square) noexcept nogil
@cython.locals(level=cython.int)
cdef void order_by_strength(Squares squares, const float[::1] strength, int[::1] order) noexcept nogil
@cython.locals(last=cython.int, fit=cython.int, room=cython.int, kept=cython.int, s=cython.int, i=cython.int)
cpdef void keep_spread(Squares squares, const int[:, ::1] pixel, const float[::1] strength, int[::1] order,
                       int[::1] place, int capacity) noexcept nogil
@cython.locals(s=cython.int, i=cython.Py_ssize_t)
cpdef int keep_strongest(Squares squares, int[:, ::1] pixel, float[::1] strength, unsigned char[:, ::1] samples,
                         int[::1] order, int[::1] square, const int[::1] share) noexcept nogil
cpdef int find_poor(Squares squares, const int[:, ::1] pixel, int[::1] square, const int[::1] few,
                    const unsigned char[:, ::1] among) noexcept nogil
@cython.locals(below=bint)
cdef int add_rectangle(Squares squares, int found, int left, int right, int row) noexcept nogil
cpdef int leave_poor(Squares squares, int[:, ::1] pixel, float[::1] strength, unsigned char[:, ::1] samples,
                     const int[::1] square) noexcept nogil
