cimport cython
from libc cimport math
from lcf_edge.filter cimport lengths, path
from lcf_edge.filter.situation cimport Situation

cdef int RANGES
cdef double NEAREST_M
cdef double FARTHEST_REACHES
cdef double FARTHEST_M
cdef double WALKS_MPS
cdef double TRAFFIC_SHARE
cdef double CHANGES_MPS
cdef double FOOT_SHARE
cdef double HIDDEN_FOOT
cdef double LIFTED_M
cdef int MAX_GROUNDS
cdef double SEEN_BENEATH
cdef double LEAST_SEEN
cdef double MEMORY_SHARE
cdef double JUMPS_HZ
cdef double ODDS
cdef double ALONG_MPS
cdef double ALONG
cdef double SLOW_MPS
cdef double SLOW
cdef double TINY
cdef double SUNK_FOOT
cdef double SMALL_M
cdef double SMALL_RATIO
cdef double SPEED_SHARE
cdef double STANDS_SHARE
cdef double MIN_SIGMA_HZ
cdef double MAX_HORIZONS
cdef double FRONT_SHARE
cdef double SIDE_SHARE
cdef double MAX_HALF_WIDTH
cdef double DEPTH_SHARE
cdef double MIN_DEPTH
cdef double MIN_WEIGHT
cdef double MIN_SHARE
cdef double UNSTEADY
cdef double CALIBRATION
cdef double RANGE_SHARE
cdef int RANGE
cdef int FORWARD
cdef int RIGHT
cdef int RATE
cdef int LATERAL
cdef int CLOSEST
cdef int QUANTITIES
cdef double ROOT_2
cdef double INFINITY
cdef double NAN

cdef class Evidence:
    cdef public double looming, sideways, mm, qq, mq, across, across_sigma, half_width, foot, foot_sigma, log_odds, reference, hidden, range_before, range_doubt, inverse, inverse_var
    cdef public double half_extent
    cdef public bint is_cut
    cdef int grounds
    cdef double[::1] ground

cdef class Belief:
    cdef public double stands, met, middle
    cdef double log_odds, middle_sigma
    cdef readonly double[::1] mean, sigma, inverse, standing, moving
    cdef double[::1] weight
    cdef double inner_forward, inner_right, inner_forward_var, inner_right_var, inner_rate, inner_rate_var

cpdef void see_ground(Evidence evidence, double inverse) noexcept nogil
cdef double log_normal2(double dm, double dq, double mm, double qq, double mq) noexcept nogil
cdef double foot_likelihood(Evidence evidence, double inverse, Situation around) noexcept nogil
cdef double memory_likelihood(Evidence evidence, double inverse, Situation around) noexcept nogil
cdef double speed_change_log(Evidence evidence, double inverse) noexcept nogil
cdef double small_log(Evidence evidence, double inverse) noexcept nogil
cdef double walking_mps(Situation around) noexcept nogil
@cython.locals(most=double, stands=double, moves=double, inverse=double, place=double, changed=double)
cdef void weigh(Belief belief, Evidence evidence, Situation around) noexcept nogil
@cython.locals(expected=double, wrong=double, expected_var=double, measured=double, gain=double)
cdef void suppose_standing(Belief belief, Evidence evidence, double inverse, Situation around) noexcept nogil
cdef void suppose_moving(Belief belief, Evidence evidence, double inverse, Situation around) noexcept nogil
cdef double lateral_at(Belief belief, Evidence evidence, double inverse, Situation around) noexcept nogil
cdef double lateral_var(Belief belief, Evidence evidence, double inverse) noexcept nogil
cdef double below(double value, double mean, double variance) noexcept nogil
cdef double within(double most, double mean, double variance) noexcept nogil
cdef double met_probability(Belief belief, Evidence evidence, double inverse, Situation around) noexcept nogil
cdef void take(Belief belief, int quantity, double weight, double value, double variance) noexcept nogil
@cython.locals(time_s=double)
cdef void suppose(Belief belief, double weight, Evidence evidence, double inverse, Situation around) noexcept nogil
cdef void conclude(Belief belief) noexcept nogil
@cython.locals(half_width=double)
cdef void set_front(Belief belief, Evidence evidence) noexcept nogil
cpdef void consider(Belief belief, Evidence evidence, Situation around) noexcept nogil
