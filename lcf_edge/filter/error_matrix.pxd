cimport cython
from libc cimport math
from lcf_edge.filter cimport baselines as lines
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.situation cimport Situation

cdef double MAX_FOCUS_SHARE

cdef class MotionError:
    cdef double xx, xy, yy

cpdef void start(EdgeColumns edges, Py_ssize_t i, double corner_var, double speed_var) noexcept nogil
cpdef void predict(EdgeColumns edges, Py_ssize_t i, double dt_s) noexcept nogil
cpdef void correct(EdgeColumns edges, Py_ssize_t i, double share, double corner_var, double dt_s) noexcept nogil
cpdef void of_rotation(MotionError error, Baselines baselines, EdgeColumns edges, Py_ssize_t i, Py_ssize_t slot, double x, double y, Situation around) noexcept nogil
@cython.locals(i=int, j=int)
cdef void add_rate(MotionError error, Baselines baselines, Py_ssize_t slot, double x, double y, Situation around) noexcept nogil
cpdef double add_places(MotionError error, EdgeColumns edges, Py_ssize_t i, Situation around) noexcept nogil
cpdef double add_focus(MotionError error, double mu, double cos, double sin, Situation around) noexcept nogil
cpdef double variance(MotionError error, double cos, double sin) noexcept nogil
