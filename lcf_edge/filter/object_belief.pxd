cimport cython
from libc cimport math
from lcf_edge.filter cimport image_plane, lengths, path, range_belief, situation
from lcf_edge.filter.columns cimport ObjectColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.range_belief cimport Belief, Evidence
from lcf_edge.filter.situation cimport Situation

cdef double UNSEEN_MPS
cdef double BODY_SHARE
cdef double BODY_HZ
cdef double SWING_SHARE
cdef double SWING_HZ
cdef double PERSISTS_S
cdef double MAX_ODDS
cdef double FOOT_S
cdef double FOOT_BELOW_S
cdef double FOOT_PX
cdef double BORDER_PX
cdef double CUT_SHARE
cdef double CUT_HIDES
cdef double MOVES_SIGMAS
cdef double SLOW_MPS
cdef double INTO_PATH
cdef double FOOT_SHARE
cdef double ASSUMED_SHARE
cdef double STILL_HZ
cdef double RATE_SIGMAS
cdef double EVEN
cdef double MAX_RANGE_M
cdef int UNKNOWN
cdef int STANDING
cdef int CROSSING
cdef int ONCOMING
cdef int LEADING
cdef int CUTTING_IN
cdef double INFINITY
cdef double NAN

@cython.locals(whole=double, shown=double, per_m=double, bottom=double, kept=double)
cdef void collect_evidence(Evidence evidence, ObjectColumns objects, Py_ssize_t o, ImagePlane plane, Situation around) noexcept nogil
cdef void believe(ObjectColumns objects, Py_ssize_t o, Belief belief, Evidence evidence, Situation around) noexcept nogil
cdef void set_contact(ObjectColumns objects, Py_ssize_t o, double rate, double sigma, Situation around) noexcept nogil
@cython.locals(into_path=bint, goes_on=bint, goes_aside=bint)
cdef int class_of(ObjectColumns objects, Py_ssize_t o, Belief belief, Evidence evidence) noexcept nogil
cdef bint rests(ObjectColumns objects, Py_ssize_t o, Situation around) noexcept nogil
cdef bint is_still(ObjectColumns objects, Py_ssize_t o) noexcept nogil
@cython.locals(time_s=double, time_sigma_s=double, drift_mps=double)
cdef void coast(ObjectColumns objects, Py_ssize_t o, Evidence evidence, Situation around) noexcept nogil
@cython.locals(range_m=double, doubt=double)
cdef void believe_without_speed(ObjectColumns objects, Py_ssize_t o, Evidence evidence, Situation around) noexcept nogil
