from libc cimport math

cdef double PI
cdef double MIN_SCALE

cdef class Pinhole:
    cdef readonly double fx, fy, cx, cy, focal

cdef class Homography:
    cdef double xx, xy, xw, yx, yy, yw, wx, wy, ww
    cdef readonly double x, y

cpdef double wrap(double angle) noexcept nogil
cpdef double line_distance(double dx, double dy, double cos, double sin) noexcept nogil
cpdef void set_homography(Homography h, Pinhole pinhole, const double[:, :, ::1] rotation, Py_ssize_t k) noexcept nogil
cpdef void warp(Homography h, double x, double y) noexcept nogil
