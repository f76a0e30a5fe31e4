cimport cython
from libc cimport math
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.rebel_detection cimport Verdicts
from lcf_edge.filter cimport rebel_detection, rounding
from lcf_edge.filter.situation cimport Situation

cdef int BINS
cdef double SLOWEST_MPS
cdef double BIN_RATIO
cdef double SPREAD
cdef int MIN_EDGES
cdef double MIN_SHARE
cdef double MIN_BELOW
cdef double OUTWARD_SIGMAS
cdef double MIN_ROWS
cdef double SLOPE_SIGMA_RAD
cdef double MIN_SIGMA
cdef double NAN

cdef class GroundSpeed:
    cdef public double speed_mps, sigma_mps, elapsed_s
    cdef int[::1] votes
    cdef int count
    cdef double below, rows, squares, sum, elapsed

@cython.locals(outward=double)
cdef double says_mps(Verdicts verdicts, Py_ssize_t j, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
@cython.locals(k=int)
cdef int bin_of(double speed_mps) noexcept nogil
@cython.locals(most=int, best=int, votes=int, k=int)
cdef int fullest(GroundSpeed ground) noexcept nogil
@cython.locals(k=int, n=int, says=double, below=double)
cpdef void measure(GroundSpeed ground, EdgeColumns edges, Verdicts verdicts, Baselines baselines, Situation around) noexcept nogil
