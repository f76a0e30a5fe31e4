cimport cython
from libc.stdlib cimport abs
from lcf_edge.filter cimport rounding

cdef int KEYS
cdef int WINDOW
cdef int PIXELS
cdef int STEP
cdef int LIGHTER
cdef int NO_WORLD

cdef class Blocks:
    cdef readonly int width, height, columns, rows
    cdef unsigned char[::1] now, kept, hidden, pieces, then
    cdef unsigned long long[::1] words, words_last, words_then
    cdef int[::1] rough, block
    cdef int count, keys

@cython.locals(k=cython.Py_ssize_t, pixels=cython.Py_ssize_t)
cdef void take(Blocks blocks, const unsigned char[::1] small) noexcept nogil
cdef bint has_image(Blocks blocks) noexcept nogil
@cython.locals(column=int, row=int)
cdef int grey(Blocks blocks, double x, double y) noexcept nogil
@cython.locals(k=int)
cpdef void hide(Blocks blocks, const unsigned char[::1] hidden) noexcept nogil
@cython.locals(x=int, y=int, word=cython.ulonglong, grey=cython.ulonglong)
cdef void lay_out(Blocks blocks, const unsigned char[::1] picture, int first, unsigned long long[::1] words) noexcept nogil
@cython.locals(k=cython.Py_ssize_t, first=cython.Py_ssize_t, pixels=cython.Py_ssize_t)
cpdef void keep(Blocks blocks, int slot) noexcept nogil
@cython.locals(k=cython.Py_ssize_t)
cdef void look_back(Blocks blocks) noexcept nogil
cdef void look_farther_back(Blocks blocks, int slot) noexcept nogil
@cython.locals(across=int, b=int, k=int, row=int, total=int, here=int, below=int)
cdef void roughen(Blocks blocks) noexcept nogil
@cython.locals(total=int, there=cython.Py_ssize_t, k=cython.Py_ssize_t)
cdef int difference(Blocks blocks, Py_ssize_t here, int x, int y, int most) noexcept nogil
@cython.locals(total=int, now=int, before=int, light=int, there=cython.Py_ssize_t, k=cython.Py_ssize_t)
cdef int shape_difference(Blocks blocks, Py_ssize_t here, int x, int y, int most) noexcept nogil
