cimport cython

cdef long long APART_NS
cdef int MIN_CORNERS
cdef int NEAR_PX
cdef int CELL_PX
cdef double SHARE

cdef class Stillness:
    cdef Py_ssize_t columns
    cdef int marks
    cdef unsigned char[::1] then, latest
    cdef long long then_ns, latest_ns
    @cython.locals(corners=cython.Py_ssize_t)
    cpdef look(self, long long stamp_ns, const int[:, ::1] pixel)

@cython.locals(cell=cython.Py_ssize_t, i=cython.Py_ssize_t, x=cython.int, y=cython.int)
cdef void mark(unsigned char[::1] near, Py_ssize_t columns, const int[:, ::1] pixel) noexcept nogil
@cython.locals(i=cython.Py_ssize_t, number=cython.int)
cdef int count_near(const unsigned char[::1] near, Py_ssize_t columns, const int[:, ::1] pixel) noexcept nogil
