cimport cython
from libc cimport math
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport rounding
from lcf_edge.filter cimport edge_equations, flow, image_plane, lengths, path
from lcf_edge.filter.circles cimport Ids, Members
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double SPEED_NOISE_PX
cdef double PASSING_WIDTHS
cdef double DEPTH_SPREAD
cdef double INSIDE_RADII
cdef double INSIDE_MARGIN_PX
cdef double SUDDEN_CHANGE
cdef double ALIGNED_SHARE
cdef int SLOWEST_OCTAVE
cdef double SLOWEST
cdef int OCTAVES
cdef int CELLS
cdef double MIN_EXPANSION
cdef double MIN_R_PX

cdef class Flowing:
    cdef Py_ssize_t count, open_count
    cdef int[::1] row, cell, cell_size, before, included, open
    cdef double[::1] r, cos, sin, expansion, mean_cos, mean_sin, mean_expansion, beta_cos, beta_sin
    cdef Members members

cpdef void predict(CircleColumns circles, ImagePlane plane, Situation around) noexcept nogil
cpdef bint passes_by(CircleColumns circles, Py_ssize_t c, Situation around) noexcept nogil
cdef void gather(Flowing flowing, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cdef bint lies_inside(EdgeColumns edges, Py_ssize_t i, CircleColumns circles, Py_ssize_t c) noexcept nogil
cdef bint fits(Flowing flowing, Py_ssize_t j, EdgeColumns edges, CircleColumns circles, Py_ssize_t c, Situation around, Settings settings) noexcept nogil
cdef int nearest_open(Flowing flowing, EdgeColumns edges, Py_ssize_t i, CircleColumns circles) noexcept nogil
cdef void open_circles(Flowing flowing, CircleColumns circles, unsigned char[::1] ignored) noexcept nogil
cdef void involve(Flowing flowing, EdgeColumns edges, CircleColumns circles, Situation around, Settings settings) noexcept nogil
cdef void average(Flowing flowing, Members members, EdgeColumns edges) noexcept nogil
cdef bint is_involved(Flowing flowing, Py_ssize_t c, Settings settings) noexcept nogil
cdef bint is_aligned(Flowing flowing, CircleColumns circles, Py_ssize_t c, Settings settings) noexcept nogil
cdef void compare(Flowing flowing, CircleColumns circles, unsigned char[::1] ignored, Settings settings) noexcept nogil
cdef void direct(CircleColumns circles, Situation around) noexcept nogil
cdef int cell_of(double x, double y, double expansion, Situation around, double size_px) noexcept nogil
cdef void sort_left(Flowing flowing, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cdef int largest_cell(Flowing flowing, int support) noexcept nogil
cdef void average_cell(Flowing flowing, int cell, Members members, EdgeColumns edges, Py_ssize_t c) noexcept nogil
cdef void found(Flowing flowing, EdgeColumns edges, CircleColumns circles, Situation around, Settings settings, Ids ids) noexcept nogil
cpdef void update(Flowing flowing, EdgeColumns edges, CircleColumns circles, unsigned char[::1] ignored, Situation around, Settings settings, Ids ids) noexcept nogil
@cython.locals(edges=int)
cpdef double mean_expansion(CircleColumns circles) noexcept nogil
