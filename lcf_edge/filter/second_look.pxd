cimport cython
from libc cimport math
from libc.stdlib cimport abs
from lcf_edge.filter cimport image_plane, matching, rounding
from lcf_edge.filter.columns cimport CornerColumns, EdgeColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.matching cimport CornerIndex
from lcf_edge.filter.settings cimport Settings

cdef int APPEARANCE_SAMPLES
cdef int REACH_PX
cdef int BORDER_PX
cdef double HOPELESS
cdef double LIKENESS
cdef double LEAST_RISE_GREY
cdef double ROUNDNESS
cdef double ROOT_HALF
cdef double ALIKE_PX
cdef double CLOSE_PX
cdef int MEAN_GREY

cdef class SecondLook:
    cdef readonly int[::1] ring, grey
    cdef readonly int x, y, unlike
    cdef readonly double beside, below

@cython.locals(total=int, shift=int, away=int, k=int)
cdef int difference(SecondLook look, const unsigned char[::1] smooth, Py_ssize_t at, EdgeColumns edges, Py_ssize_t i) noexcept nogil
@cython.locals(x=int, y=int, before=int, away=int, down=int, right=int, _=int)
cdef void descend(SecondLook look, const unsigned char[::1] smooth, Py_ssize_t width, EdgeColumns edges, Py_ssize_t i) noexcept nogil
@cython.locals(at=Py_ssize_t, twice=int, left=int, right=int, above=int, below=int, falling=int, rising=int)
cdef bint is_round(SecondLook look, const unsigned char[::1] smooth, Py_ssize_t width, EdgeColumns edges, Py_ssize_t i) noexcept nogil
cdef bint is_doubtful(SecondLook look, CornerIndex index, EdgeColumns edges, Py_ssize_t i, CornerColumns corners, Settings settings) noexcept nogil
@cython.locals(margin=int, is_inside=bint)
cdef bint search(SecondLook look, const unsigned char[::1] smooth, ImagePlane plane, EdgeColumns edges, Py_ssize_t i, Settings settings) noexcept nogil
cdef void enter(SecondLook look, ImagePlane plane, EdgeColumns edges, Py_ssize_t i, CornerColumns corners) noexcept nogil
cpdef int find(SecondLook look, const unsigned char[::1] smooth, CornerIndex index, ImagePlane plane, EdgeColumns edges, CornerColumns corners, Settings settings) noexcept nogil
