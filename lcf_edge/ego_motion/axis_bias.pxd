cimport cython
from libc cimport math

cdef double PRIOR_VARIANCE
cdef double DRIFT_RADPS
cdef double FLOW_TIME_S
cdef double OUTLIER
cdef double MIN_VARIANCE

@cython.final
cdef class AxisBias:
    cdef readonly double bias, measured
    cdef double flow_radps, flow, noise
    cdef double bias_bias, flow_flow, noise_noise, bias_flow, bias_noise, flow_noise
    cdef double with_bias, with_flow, with_noise, off, variance

    cpdef double sigma(self) noexcept
    cpdef double error(self) noexcept
    @cython.locals(measured=cython.double, variance=cython.double)
    cpdef double error_sigma(self) noexcept
    cpdef void forget(self) noexcept
    cpdef void set_noise(self, double sigma) noexcept
    cpdef void set_flow(self, double sigma) noexcept
    @cython.locals(kept=cython.double, grown=cython.double)
    cpdef void advance(self, double dt_s, double noise_radps, bint measured) noexcept
    cpdef bint compare(self, double bias, double flow, double noise, double observed, double sigma) noexcept
    @cython.locals(bias=cython.double, flow=cython.double, noise=cython.double)
    cpdef void learn(self) noexcept
