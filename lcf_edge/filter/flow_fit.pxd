cimport cython
from libc cimport math
from lcf_edge.filter cimport baselines as lines
from lcf_edge.filter cimport flow, key_frames, least_squares, lengths, rounding, situation
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.columns cimport EdgeColumns
from lcf_edge.filter.flow cimport Pinhole
from lcf_edge.filter.key_frames cimport KeyFrames
from lcf_edge.filter.least_squares cimport NormalEquations
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef int KEYS
cdef int MIN_EDGES
cdef int MAX_EDGES
cdef double MIN_ELAPSED_S
cdef double MIN_R_PX
cdef double TURN_SHARE
cdef double TURN_MEMORY_S
cdef double MIN_TURN_PX
cdef int MIN_TURNED
cdef int COLUMNS
cdef int ROWS
cdef double CELL_EDGES
cdef double SCALE_CELL_EDGES
cdef double NOISE_MEMORY_S
cdef double MAX_EXCESS
cdef double NOISE_PX
cdef double RATE_SIGMA_RADPS
cdef double WINDOW_S
cdef int ROUNDS
cdef double NARROWING
cdef double MIN_WIDTH_PX
cdef double FIRST_WIDTH
cdef int SLOT_EDGES
cdef int UNSURE_SLOT_EDGES
cdef double UNSURE_PX
cdef double UNSURE_SIGMAS
cdef int SLOT_ROUNDS
cdef double SLOT_WIDTH_PX
cdef double SLOT_NARROWING
cdef double SLOT_SHARE
cdef double SLOT_SIGMA_RAD
cdef double DOUBTED_PX
cdef double SCALE_SHARE
cdef double SCALE_SIGMAS
cdef int BINS
cdef double BIN_PX
cdef int UNKNOWNS
cdef int FOCUS_X
cdef int FOCUS_Y

cdef class FlowFit:
    cdef public int count
    cdef public double focus_x, focus_y, focus_sigma_x, focus_sigma_y, prior_x, prior_y, scale_px, turn_share
    cdef double place_var
    cdef readonly double[::1] drift, pitch, yaw, roll, elapsed_s, share, turned, rest
    cdef double[::1] on_x, on_y
    cdef readonly int[::1] slot, cells
    cdef int[::1] cell, row
    cdef double[::1] bins
    cdef NormalEquations equations

cdef bint shows_flow(EdgeColumns edges, Py_ssize_t i, KeyFrames keys, Situation around, Settings settings) noexcept nogil
@cython.locals(place_var=double)
cdef void gather(FlowFit fit, EdgeColumns edges, KeyFrames keys, Baselines baselines, Situation around, Settings settings) noexcept nogil
cdef void note(FlowFit fit, EdgeColumns edges, Py_ssize_t i, int slot, Baselines baselines, Pinhole pinhole) noexcept nogil
cdef bint shows_turn(FlowFit fit, Py_ssize_t k) noexcept nogil
cdef double quantile(FlowFit fit, double share, bint only_turned, double turn_share) noexcept nogil
cpdef double weight_of(double rest_px, double width_px) noexcept nogil
cdef void set_row(FlowFit fit, Py_ssize_t k) noexcept nogil
cdef double explained(FlowFit fit) noexcept nogil
cdef double rate_sigma(FlowFit fit, Baselines baselines, double focal) noexcept nogil
cdef void solve(FlowFit fit, double sigma_radps) noexcept nogil
@cython.locals(count=int, better=int, asked=int, turned=double)
cdef bint suits_older(FlowFit fit, int k, EdgeColumns edges, Baselines baselines, Pinhole pinhole) noexcept nogil
@cython.locals(is_large=bint)
cdef void turn_slot(FlowFit fit, int k, EdgeColumns edges, KeyFrames keys, Baselines baselines, Pinhole pinhole, double sigma_rad, double width) noexcept nogil
cdef int slot_edges(FlowFit fit, int k) noexcept nogil
@cython.locals(width=double)
cdef void apply(FlowFit fit, EdgeColumns edges, KeyFrames keys, Baselines baselines, Pinhole pinhole, double sigma_radps) noexcept nogil
cdef void learn_turn_share(FlowFit fit, double dt_s) noexcept nogil
cdef void learn_corner_noise(FlowFit fit, Situation around) noexcept nogil
cpdef void measure(FlowFit fit, EdgeColumns edges, KeyFrames keys, Baselines baselines, Situation around, Settings settings) noexcept nogil
