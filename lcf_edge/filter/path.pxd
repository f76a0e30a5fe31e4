from libc cimport math
from lcf_edge.filter.situation cimport Situation

cdef double INFINITY
cdef double MIN_CURVATURE
cdef double MIN_SPEED_MPS
cdef double SMALL_TURN_RAD
cdef double TURN_LASTS_S

cdef double arc_radius_m(double yaw_rate_radps, Situation around) noexcept nogil
cdef double miss_at(double yaw_rate_radps, double right_m, double ahead_m, Situation around) noexcept nogil
cpdef double miss(double right_m, double ahead_m, Situation around) noexcept nogil
cpdef double least_miss(double right_m, double ahead_m, Situation around) noexcept nogil
cpdef double way_to(double right_m, double ahead_m, Situation around) noexcept nogil
