cimport cython
from libc cimport math
from libc.stdlib cimport abs
from lcf_edge.filter cimport rounding
from lcf_edge.filter cimport image_plane
from lcf_edge.filter.columns cimport CornerColumns, EdgeColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.settings cimport Settings

cdef int CELL_SHIFT
cdef double DISTANCE_COST
cdef double LIKENESS_FLOOR
cdef double WIDE_LIKENESS
cdef int APPEARANCE_SAMPLES
cdef int MEAN_GREY
cdef double MEAN_OF_SUM
cdef int ROUNDS

cdef class CornerIndex:
    cdef readonly int columns, rows, nbytes
    cdef readonly int[::1] start, order
    cdef int[::1] listed
    cdef readonly double[::1] x, y
    cdef readonly unsigned char[:, ::1] appearance
    cdef unsigned long long[:, ::1] words

cpdef void take_corners(CornerColumns corners, const int[:, ::1] pixel, const float[:, ::1] position, const unsigned long long[:, ::1] words) noexcept nogil
cpdef int cell_of(CornerIndex index, int x, int y) noexcept nogil
cpdef void fill(CornerIndex index, CornerColumns corners) noexcept nogil
cpdef int first_cell(double middle, double gate, int cells) noexcept nogil
cpdef int last_cell(double middle, double gate, int cells) noexcept nogil
@cython.locals(total=int)
cpdef double difference(EdgeColumns edges, Py_ssize_t i, CornerIndex index, Py_ssize_t place) noexcept nogil
@cython.locals(total=int)
cpdef double contrast(EdgeColumns edges, Py_ssize_t i) noexcept nogil
cpdef double likeness_needed(double own_contrast, Settings settings) noexcept nogil
@cython.locals(count=int)
cdef int list_near(CornerIndex index, CornerColumns corners, double x, double y, double gate) noexcept nogil
@cython.locals(edge_has_better=bint)
cdef void choose(CornerIndex index, EdgeColumns edges, Py_ssize_t i, CornerColumns corners, double x, double y, double gate, double most) noexcept nogil
cdef double gate_px(EdgeColumns edges, Py_ssize_t i, double slack_px, bint wide, Settings settings) noexcept nogil
@cython.locals(nothing_there=bint)
cdef int choose_all(CornerIndex index, ImagePlane plane, EdgeColumns edges, CornerColumns corners, double slack_px, bint wide, Settings settings, bint again) noexcept nogil
cdef int take_mutual(EdgeColumns edges, CornerColumns corners) noexcept nogil
cdef int look(CornerIndex index, ImagePlane plane, EdgeColumns edges, CornerColumns corners, double slack_px, bint wide, Settings settings) noexcept nogil
cpdef int find(CornerIndex index, ImagePlane plane, EdgeColumns edges, CornerColumns corners, double slack_px, Settings settings) noexcept nogil
