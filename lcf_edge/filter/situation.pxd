from libc cimport math
from lcf_edge.filter.flow cimport Pinhole

cdef double SLOWEST_MPS
cdef double ASSUMED_WIDTHS_HZ
cdef double LASTING_TURN_S
cdef double INFINITY
cdef double NAN

cdef class Situation:
    cdef public Pinhole pinhole
    cdef public double scene_depth_m, camera_height_m, half_width_m, height_m, horizon_s, pitch_sigma_rad, horizon_sigma_rad
    cdef public double focus_x, focus_y, horizon_y, dt_s, speed_mps, assumed_mps, ground_mps, turn_share, lever_m, yaw_rate_radps
    cdef public double lasting_yaw_radps
    cdef double scene_flow_pxps
    cdef public bint flow_is_seen, is_blind
    cdef bint ground_is_still
    cdef public bint floor_mirrors
    cdef public double noise_px, corner_var, excess, focus_var_x, focus_var_y, lasting_var_x, lasting_var_y
    cdef double least_corner_var

cpdef void follow(Situation around, double ray_x, double ray_y, double speed_mps, double yaw_rate_radps, double dt_s) noexcept nogil
cdef bint is_at_rest(Situation around) noexcept nogil
cpdef double ground_range_m(Situation around, double y) noexcept nogil
cpdef double ground_inverse(Situation around, double y) noexcept nogil
