from libc cimport math
from lcf_edge.filter cimport flow

cdef double CORNER_NOISE_PX
cdef double MAX_DEVIATION_RAD
cdef int BEYOND
cdef int FOLLOWS
cdef int DISAGREES
cdef int BREAKS
cdef int STAYS
cdef double UNMATCHED

cpdef double trust_change(int relation) noexcept nogil
cpdef double predict_speed(double speed, double expected_speed) noexcept nogil
cpdef double predict_place(double place, double speed, double direction, double dt_s) noexcept nogil
cpdef int classify(double moved_x, double moved_y, double ahead_x, double ahead_y, double cos, double sin, double speed, double bl, double delta_px, double eps_beta_rad) noexcept nogil
cpdef double update_position(double trust, double tr_cr, double predicted, double measured) noexcept nogil
cdef double share_of_corner(double trust, double tr_cr) noexcept nogil
cpdef double update_speed(double trust, double tr_cr, double speed, double along, double dt_s) noexcept nogil
cpdef double update_gate(double bl, double speed, double predicted_speed, double corr, double dt_s, double min_px, double max_px) noexcept nogil
cpdef double update_deviation(double deviation, double turn) noexcept nogil
cpdef double change_trust(double trust, double change, double tr_max) noexcept nogil
cdef double bound_deviation(double deviation) noexcept nogil
