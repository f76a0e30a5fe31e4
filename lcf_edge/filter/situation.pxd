from libc cimport math
from lcf_edge.filter.flow cimport Pinhole

cdef double PITCH_MEMORY_S
cdef double YAW_MEMORY_S
cdef double INFINITY
cdef double NAN

cdef class Heading:
    cdef public double mounted_x, mounted_y, ray_x, ray_y

cdef class Situation:
    cdef public Pinhole pinhole
    cdef public double scene_depth_m, camera_height_m, half_width_m, height_m, horizon_s, pitch_sigma_rad
    cdef public double focus_x, focus_y, horizon_y, dt_s, speed_mps, yaw_rate_radps, scene_flow_pxps

cpdef void turn_heading(Heading heading, const double[:, :, ::1] rotation, double yaw_rate_radps, double dt_s) noexcept nogil
cpdef void follow(Situation around, Heading heading, double speed_mps, double yaw_rate_radps, double dt_s) noexcept nogil
cpdef double ground_range_m(Situation around, double y) noexcept nogil
