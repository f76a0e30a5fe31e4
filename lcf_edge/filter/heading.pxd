from libc cimport math
from lcf_edge.filter.flow_fit cimport FlowFit
from lcf_edge.filter.situation cimport Situation

cdef double PITCH_MEMORY_S
cdef double YAW_MEMORY_S
cdef double MOUNTING_SIGMA_RAD
cdef double SHAKE_SIGMA_RAD
cdef double MOUNTING_DRIFT_RAD
cdef double FIT_WINDOW_S
cdef double MAX_MOUNTING_SIGMAS
cdef double LEVER_WIDTHS
cdef double LEVER_DRIFT
cdef double MIN_SPEED_MPS
cdef double MAX_CURVATURE
cdef double MIN_VARIANCE
cdef double STRAIGHT_RADPS
cdef double INFINITY

cdef class Heading:
    cdef readonly double mounted_x, mounted_y, ray_x, ray_y, sigma_x, sigma_y, aside_x
    cdef readonly double lever_m, lever_sigma_m, shared, curvature, half_width_m

cpdef void turn_heading(Heading heading, const double[:, :, ::1] rotation, double yaw_rate_radps, double dt_s) noexcept nogil
cpdef double focus_variance(double sigma_rad) noexcept nogil
cpdef double focus_sigma_rad(double mounting_sigma_rad) noexcept nogil
cpdef void turn_aside(Heading heading, double speed_mps, double yaw_rate_radps) noexcept nogil
cpdef double sideways_sigma_rad(Heading heading) noexcept nogil
cpdef void learn_mounting(Heading heading, Situation around, FlowFit fit) noexcept nogil
cpdef double unpulled(double shift_rad, double prior_rad, double sigma_rad) noexcept nogil
cdef bint knows_curvature(Situation around) noexcept nogil
cdef void learn_sideways(Heading heading, double shift_rad, double noise, double dt_s) noexcept nogil
cpdef double fit_noise(double prior_rad, double sigma_rad, double dt_s) noexcept nogil
cpdef double mounting_gain(double mounting_rad, double noise) noexcept nogil
cpdef double drifted(double sigma_rad, double gain, double dt_s) noexcept nogil
