cimport cython

cdef int REACH_PX, BLOCK
cdef unsigned long long LOW_BITS, HIGH_BITS, ONES, PLACES

cdef class Scores:
    cdef int width, dark
    cdef unsigned char[::1] plane
    cdef unsigned long long[::1] words
    cdef int[::1] above, some
    cdef Py_ssize_t[::1] ring
    cdef unsigned char[:, ::1] around, least, best

@cython.locals(at=cython.Py_ssize_t, down=cython.Py_ssize_t, one=cython.uchar, other=cython.uchar, grey=cython.uchar,
               bright=cython.uchar, dark=cython.uchar, above=cython.uchar, below=cython.uchar)
cpdef void bound(Scores scores, const unsigned char[::1] image) noexcept nogil
@cython.locals(i=cython.int, part=cython.int, above=cython.int, start=cython.int, corners=cython.int, row=cython.int,
               y=cython.int, at=cython.int, least=cython.int, left=cython.int, top=cython.int, right=cython.int, bottom=cython.int)
cpdef int find(Scores scores, const unsigned char[::1] image, int threshold, int on_dark,
               const int[:, ::1] parts, int[:, ::1] pixel, float[::1] strength) noexcept nogil
@cython.locals(y=cython.int, at=cython.int, darkest=cython.uchar)
cdef bint is_dark(Scores scores, const unsigned char[::1] image, int left, int top, int right, int bottom) noexcept nogil
@cython.locals(y=cython.int, first=cython.int, last=cython.int, w=cython.int, at=cython.int, count=cython.int,
               word=cython.ulonglong, next_word=cython.ulonglong, high=cython.ulonglong,
               lowest=cython.ulonglong, add=cython.ulonglong, hits=cython.int, k=cython.int)
cdef int list_above(Scores scores, int threshold, int left, int top, int right, int bottom) noexcept nogil
@cython.locals(i=cython.Py_ssize_t, k=cython.Py_ssize_t, at=cython.Py_ssize_t, first=cython.Py_ssize_t,
               second=cython.Py_ssize_t, third=cython.Py_ssize_t, fourth=cython.Py_ssize_t, count=cython.Py_ssize_t,
               grey=cython.int, score=cython.int)
cdef int score_block(Scores scores, const unsigned char[::1] image, int threshold, int start, int end,
                     int corners) noexcept nogil
@cython.locals(i=cython.Py_ssize_t, k=cython.Py_ssize_t, eight=cython.uchar, ends=cython.uchar)
cdef void brightest_arc(Scores scores, Py_ssize_t count, int into) noexcept nogil
@cython.locals(u=cython.int, v=cython.int, at=cython.int, above=cython.int, below=cython.int, most=cython.uchar,
               score=cython.uchar)
cdef bint is_peak(Scores scores, int x, int y, int left, int top, int right, int bottom) noexcept nogil
