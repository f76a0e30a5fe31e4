cimport cython
from libc cimport math
from lcf_edge.filter cimport flow, key_frames, rebel_detection
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.key_frames cimport KeyFrames
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.rebel_detection cimport Verdicts
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef int KEYS
cdef double MIN_BASELINE_S
cdef int PENDING
cdef double OBEYING_COSTS

cdef bint is_still(EdgeColumns edges, double over_s, double motion_px) noexcept nogil
cpdef bint key_is_due(EdgeColumns edges, KeyFrames keys, double dt_s, Settings settings) noexcept nogil
cpdef void mark_key(EdgeColumns edges, KeyFrames keys) noexcept nogil
cpdef void judge_all(Verdicts verdicts, EdgeColumns edges, KeyFrames keys, Baselines baselines, Situation around, Settings settings) noexcept nogil
cdef bint breaks_flow(Verdicts verdicts, Py_ssize_t j) noexcept nogil
cdef double outward_speed(EdgeColumns edges, Py_ssize_t i, Situation around) noexcept nogil
cpdef void send_home(EdgeColumns edges, Py_ssize_t i, Situation around, Settings settings) noexcept nogil
cpdef void release_obedient(Verdicts verdicts, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cdef void wait(EdgeColumns edges, Py_ssize_t i, bint key, Situation around) noexcept nogil
cdef int middle_key(Verdicts verdicts, Py_ssize_t j, KeyFrames keys, bint key) noexcept nogil
cpdef int decide(Verdicts verdicts, Verdicts recent, EdgeColumns edges, KeyFrames keys, bint key, Baselines baselines, int[::1] born, Situation around) noexcept nogil
cpdef void give_births(Verdicts verdicts, Verdicts recent, EdgeColumns edges, KeyFrames keys, bint key, Baselines baselines, int[::1] born, int births, Settings settings) noexcept nogil
cpdef int gather_rebels(Verdicts verdicts, EdgeColumns edges, int[::1] breaking) noexcept nogil
