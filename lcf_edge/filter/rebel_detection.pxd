cimport cython
from libc cimport math
from lcf_edge.filter cimport baselines as lines
from lcf_edge.filter cimport edge_equations, error_matrix, flow, lengths, path
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.error_matrix cimport MotionError
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double NEAREST_M
cdef double MOVER_SIGMAS
cdef double GROUP_SIGMAS
cdef int GROUP_SIZE
cdef double TOGETHER_SIGMAS
cdef double ODD_SIGMAS
cdef double SAME_WAY
cdef double PARALLAX_DRIFT
cdef double LINK_RATIO
cdef double GROUND_DIPS
cdef double COMMON_NOISE_PX
cdef double ALIKE_SIGMAS
cdef double OWN_SIGMAS
cdef double NEAR_PATH
cdef double SWERVE_SHARE
cdef double NEAR_SIGMAS
cdef int MAX_CANDIDATES
cdef double NEW_THREAT
cdef double RANGE_SIGMAS
cdef double GROUND_SIGMAS
cdef double SLOWER_HORIZONS
cdef double MIN_INVERSE_RANGE
cdef double MIN_LEVER2
cdef double MIN_OUTWARD_PX
cdef double MIN_R_PX
cdef double LINK_NOISE_SIGMAS
cdef double CLOSING_NOISE_SIGMAS
cdef double MIN_FIRST_LINK_PX

cdef class Verdicts:
    cdef public Py_ssize_t count
    cdef readonly int[::1] row, slot
    cdef int[::1] oldest, near
    cdef readonly double[::1] x, y, r, drift, short, over, outward, expansion, sigma, astray, noise, across
    cdef double[::1] along, inverse, inverse_sigma, near_x, near_y, lever_x, lever_y, weight, common, level
    cdef readonly unsigned char[::1] mover, incoming
    cdef unsigned char[::1] together
    cdef Py_ssize_t near_count
    cdef double shared, shared_sigma, worse
    cdef MotionError error

cpdef void link(Verdicts verdicts, Py_ssize_t j, EdgeColumns edges, Py_ssize_t i, Py_ssize_t slot, Baselines baselines) noexcept nogil
@cython.locals(drifts=bint, strays=bint)
cpdef void judge(Verdicts verdicts, Py_ssize_t j, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
cdef double ground_outward(double y, double lever, Situation around) noexcept nogil
cdef double sigma_px(Verdicts verdicts, Py_ssize_t j) noexcept nogil
cdef double common_px(Verdicts verdicts, Py_ssize_t j) noexcept nogil
cdef double unusual_px(Situation around) noexcept nogil
cdef double lever_of(Verdicts verdicts, Py_ssize_t j, Baselines baselines) noexcept nogil
@cython.locals(number=double, total=double, mean=double, outward=double)
cdef bint moves_together(Verdicts verdicts, Py_ssize_t j, double[::1] off, double[::1] sigma, double parallax, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cdef void find_moving_together(Verdicts verdicts, EdgeColumns edges, Situation around, Settings settings) noexcept nogil
cdef void near_path(Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around) noexcept nogil
cdef bint are_alike(Verdicts verdicts, Py_ssize_t a, Py_ssize_t b) noexcept nogil
@cython.locals(number=double, total=double, mx=double, my=double, mm=double, lx=double, ly=double, ll=double, lm=double, gx=double, gy=double, gg=double, gm=double)
cdef void ask_neighbours(Verdicts verdicts, Py_ssize_t a, Settings settings) noexcept nogil
cdef bint will_be_met(Verdicts verdicts, Py_ssize_t a, EdgeColumns edges, Situation around) noexcept nogil
cdef void find_incoming(Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around, Settings settings) noexcept nogil
cpdef void judge_together(Verdicts verdicts, EdgeColumns edges, Baselines baselines, Situation around, Settings settings) noexcept nogil
cpdef bint agree(Verdicts whole, Py_ssize_t j, Verdicts recent, Py_ssize_t k, Baselines baselines) noexcept nogil
cdef bint rates_agree(double old, double new, double slack) noexcept nogil
cpdef void give_birth(EdgeColumns edges, Verdicts first, Py_ssize_t j, Verdicts second, Py_ssize_t k, double elapsed_s, Settings settings) noexcept nogil
