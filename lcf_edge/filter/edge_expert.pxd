cimport cython
from libc cimport math
from lcf_edge.filter cimport edge_equations, edge_rows, error_matrix, image_plane, lengths, line_expert
from lcf_edge.filter.columns cimport CircleColumns, CornerColumns, EdgeColumns, GroupColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double USUAL_SHARE
cdef double LEAST_SHARPNESS
cdef int MIN_TRUSTED
cdef double MIN_CORR
cdef int CROSSING
cdef double SWING_SHARE
cdef double MIN_ORIGIN_PX
cdef double MIN_RADIUS_PX
cdef double STRAY_GATE_SHARE
cdef double JOIN_GATE_SHARE
cdef double ROTATION_SIGMAS
cdef double FIRST_EXPANSION_HZ
cdef double FIRST_SPEED_SHARE
cdef int FIXED_PX
cdef double MAX_FIXED_STEP_S

cdef double direct(EdgeColumns edges, Py_ssize_t i, Situation around) noexcept nogil
cpdef void predict(EdgeColumns edges, CircleColumns normal, Situation around, Settings settings) noexcept nogil
cdef int relation_of(EdgeColumns edges, Py_ssize_t i, double x, double y, double delta_px, Settings settings) noexcept nogil
cdef void go_on(EdgeColumns edges, Py_ssize_t i) noexcept nogil
cdef double sharpness(EdgeColumns edges, Settings settings) noexcept nogil
cpdef void update(EdgeColumns edges, CircleColumns normal, CircleColumns rebel, CornerColumns corners, double sigma_px, Situation around, Settings settings) noexcept nogil
cdef void take_corner(EdgeColumns edges, Py_ssize_t i, CornerColumns corners, Py_ssize_t corner, double dt_s) noexcept nogil
cdef void correct(EdgeColumns edges, Py_ssize_t i, CircleColumns normal, CircleColumns rebel, double x, double y, Situation around, Settings settings) noexcept nogil
cdef double trust_in_prediction(EdgeColumns edges, Py_ssize_t i, CircleColumns rebel, double x, double y, double dt_s, Settings settings) noexcept nogil
cdef void turn_own_way(EdgeColumns edges, Py_ssize_t i) noexcept nogil
cdef void stray(EdgeColumns edges, Py_ssize_t i, double x0, double y0, CornerColumns corners, Py_ssize_t corner, Situation around, Settings settings) noexcept nogil
cpdef void delete(EdgeColumns edges, ImagePlane plane, unsigned char[::1] dead, double tr_cr) noexcept nogil
cpdef int count_unclaimed(CornerColumns corners) noexcept nogil
cpdef void add(EdgeColumns edges, CircleColumns normal, CornerColumns corners, GroupColumns groups, Situation around, Py_ssize_t room, int key_number, Settings settings) noexcept nogil
cdef double first_expansion(double x, double y, CircleColumns normal, GroupColumns groups, Situation around, Settings settings) noexcept nogil
cdef void suspect(EdgeColumns edges, Py_ssize_t i, double vx, double vy, Situation around, Settings settings) noexcept nogil
