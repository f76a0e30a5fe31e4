from libc cimport math

cdef double NAN
cdef double MIN_RADIUS

cdef class ImagePlane:
    cdef readonly int width, height
    cdef readonly bint is_distorted
    cdef bint is_equidistant
    cdef double fx, fy, cx, cy, k1, k2, k3, k4, p1, p2, reach
    cdef readonly double u, v

cdef void distort(ImagePlane plane, double x, double y) noexcept nogil
cpdef bint project(ImagePlane plane, double x, double y) noexcept nogil
