cimport cython
from libc cimport math
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.coarse_motion cimport CoarseMotion
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.patches cimport Patches
from lcf_edge.filter.rebel_detection cimport Verdicts
from lcf_edge.filter.situation cimport Situation

cdef double FAR_PX
cdef double PIECE_NOISE
cdef double PIECE_HALF
cdef double MIN_SPREAD
cdef double PARTS_SIGMAS
cdef double PARTS_SHARE
cdef int MIN_GROUND
cdef double GROUND_GAIN
cdef double LIKE_GROUND

cdef class MotionSums:
    cdef readonly int[::1] count
    cdef readonly double[::1] weight, x, y, vx, vy, focus_x, focus_y, forward
    cdef double[::1] elapsed, common
    cdef double[::1] b2v0, b4v0, b1v1, b2v1, b0v2
    cdef readonly double[::1] left, top, right, bottom
    cdef readonly double[::1] xx, yy, xvx, yvy
    cdef double expansion, spread

cdef void clear(MotionSums sums, Py_ssize_t k) noexcept nogil
cdef void add_motion(MotionSums sums, Py_ssize_t k, double weight, double x, double y, double vx, double vy) noexcept nogil
cdef void add_edge(MotionSums sums, Py_ssize_t k, Verdicts verdicts, Py_ssize_t j, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
@cython.locals(across=double, down=double, corner=int)
cdef void add_patch(MotionSums sums, Py_ssize_t k, Patches patches, Py_ssize_t p, Situation around) noexcept nogil
cdef void add_piece(MotionSums sums, Py_ssize_t k, CoarseMotion coarse, Py_ssize_t p, Situation around) noexcept nogil
cdef void add(MotionSums sums, Py_ssize_t k, MotionSums part, Py_ssize_t c) noexcept nogil
@cython.locals(weight=double, x=double, y=double, wide=double, tall=double, parting=double, growing=double, parting_hz=double, noise=double, share=double)
cdef void fit_expansion(MotionSums sums, Py_ssize_t k) noexcept nogil
@cython.locals(left=double, per_mps=double)
cdef bint is_ground(MotionSums sums, Py_ssize_t k, Situation around) noexcept nogil
