cimport cython
from libc cimport math
from lcf_edge.filter cimport lengths, rebel_detection, situation
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.rebel_detection cimport Verdicts
from lcf_edge.filter.situation cimport Situation

cdef double MIN_BASELINE_S
cdef double MOVES_SIGMAS
cdef double MIN_R_SHARE
cdef int MIN_A_SIDE
cdef double FLOW_SHARE
cdef double MAX_ASTRAY
cdef double MAX_DRIFT_SHARE

cdef class DrivingTest:
    cdef readonly int edges, left, right
    cdef int astray
    cdef readonly bint drives

@cython.locals(r=double)
cdef bint is_away(EdgeColumns edges, Py_ssize_t i, Situation around) noexcept nogil
@cython.locals(i=cython.Py_ssize_t, slot=cython.Py_ssize_t, outward=double, drift=double)
cdef void look(DrivingTest test, Verdicts verdicts, Py_ssize_t j, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
@cython.locals(flow=int, i=cython.Py_ssize_t, j=cython.Py_ssize_t)
cpdef void measure(DrivingTest test, Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
