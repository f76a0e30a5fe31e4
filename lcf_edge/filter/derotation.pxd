cimport cython
from libc cimport math
from lcf_edge.filter cimport flow
from lcf_edge.filter.columns cimport CircleColumns, CornerColumns, EdgeColumns, PsiColumns
from lcf_edge.filter.flow cimport Homography, Pinhole
from lcf_edge.filter.settings cimport Settings

cdef double CORNER_SIGMA_PX
cdef int MIN_EDGES
cdef int MAX_EDGES
cdef int ROUNDS

cdef class OffLine:
    cdef public Py_ssize_t count
    cdef public double[::1] pitch, yaw, roll, px
    cdef public double turn_x, turn_y, turn_z, sigma

cpdef void derotate_edges(EdgeColumns edges, Homography h, double roll) noexcept nogil
cpdef void derotate_circles(CircleColumns circles, Homography h, double roll) noexcept nogil
cpdef void derotate_psi(PsiColumns psi, Homography h) noexcept nogil
cpdef void derotate_predictions(EdgeColumns edges, Homography h) noexcept nogil
cdef bint tells_rotation(EdgeColumns edges, Py_ssize_t i, double tr_s) noexcept nogil
cpdef bint measure_off_line(OffLine off, EdgeColumns edges, CornerColumns corners, Pinhole pinhole, Settings settings) noexcept nogil
cpdef void off_line(OffLine off, EdgeColumns edges, Py_ssize_t i, CornerColumns corners, Pinhole pinhole) noexcept nogil
cpdef void missing_rotation(OffLine off, double prior_sigma_rad) noexcept nogil
