cimport cython
from libc cimport math
from lcf_edge.filter cimport baselines as lines
from lcf_edge.filter cimport key_frames, lengths
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.key_frames cimport KeyFrames
from lcf_edge.filter.situation cimport Situation

cdef int KEYS
cdef double MIN_BASELINE_S
cdef double MIN_STILL_S
cdef int MIN_EDGES
cdef int MIN_GROUND_EDGES
cdef double MIN_FLOW_PX
cdef double STILL_PX
cdef double STILL_GROUND_PX
cdef double STILL_SHARE

cdef class RestTest:
    cdef readonly int edges, still, ground
    cdef int still_ground
    cdef readonly bint stands
    cdef public double measured_mps
    cdef double still_s

cdef int latest_key(KeyFrames keys) noexcept nogil
cdef void look(RestTest test, EdgeColumns edges, Py_ssize_t i, int slot, Baselines baselines, Situation around) noexcept nogil
@cython.locals(stood=bint, known=bint, seen=bint, shows_ground=bint)
cpdef void measure(RestTest test, EdgeColumns edges, KeyFrames keys, Baselines baselines, Situation around) noexcept nogil
