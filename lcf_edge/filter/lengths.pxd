from libc cimport math

cdef inline double of(double dx, double dy) noexcept nogil:
    return math.sqrt(dx * dx + dy * dy)
