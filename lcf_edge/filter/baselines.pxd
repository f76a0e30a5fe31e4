from libc cimport math
from lcf_edge.filter cimport flow
from lcf_edge.filter.flow cimport Homography, Pinhole
from lcf_edge.filter.key_frames cimport KeyFrames
from lcf_edge.filter.situation cimport Situation

cdef int KEYS
cdef double STILL_M

cdef class Baselines:
    cdef readonly double[:, ::1] h, rate_covariance
    cdef readonly double[::1] focus_x, focus_y, depth_m, elapsed_s, sigma_px
    cdef double[::1] turned_x, turned_y
    cdef public bint is_fitted

cpdef void measure(Baselines baselines, KeyFrames keys, Homography h, Pinhole pinhole, Situation around) noexcept nogil
cpdef double then_x(Baselines baselines, Py_ssize_t slot, double x, double y) noexcept nogil
cpdef double then_y(Baselines baselines, Py_ssize_t slot, double x, double y) noexcept nogil
cpdef void turn(Baselines baselines, Py_ssize_t k, Pinhole pinhole, double x, double y, double z) noexcept nogil
cpdef double turn_px(Pinhole pinhole, int axis, double x, double y, double cos, double sin) noexcept nogil
