cimport cython
from libc cimport math
from lcf_edge.filter cimport circles, image_plane, key_frames, lengths, normal_circles
from lcf_edge.filter.circles cimport Ids
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns, PsiColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.key_frames cimport KeyFrames
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double PI
cdef double SURE_BASELINE_S
cdef double RECTANGLE_FITS
cdef double MIN_PSI_FRAMES
cdef double CIRCLE_MARGINS
cdef int CIRCLE_SHAPE
cdef int RECTANGLE_SHAPE

cdef class Candidates:
    cdef readonly unsigned char[::1] ignored, passing, ready
    cdef int[::1] members, watched

cpdef void advance(PsiColumns psi, CircleColumns normal, Situation around) noexcept nogil
cpdef void mark_ignored(Candidates candidates, PsiColumns psi) noexcept nogil
@cython.locals(some=bint, trusted=bint)
cdef bint mark_ready(Candidates candidates, CircleColumns normal, Situation around, Settings settings) noexcept nogil
cdef void keep_watched(Candidates candidates, CircleColumns normal, EdgeColumns edges, KeyFrames keys) noexcept nogil
cdef int best_supported(Candidates candidates, CircleColumns normal) noexcept nogil
cdef int free_row(PsiColumns psi) noexcept nogil
cdef void write_region(PsiColumns psi, Py_ssize_t p, CircleColumns normal, Py_ssize_t c, double life_s, Ids ids) noexcept nogil
cpdef int write(PsiColumns psi, CircleColumns normal, EdgeColumns edges, Candidates candidates, KeyFrames keys, Situation around, Settings settings, Ids ids) noexcept nogil
cdef bint is_near(PsiColumns psi, Py_ssize_t p, double x, double y, double reach_px) noexcept nogil
cdef void end_near(PsiColumns psi, double x, double y, double reach_px) noexcept nogil
@cython.locals(inside=bint)
cdef void end_aside(PsiColumns psi, Candidates candidates, ImagePlane plane, double margin_px) noexcept nogil
cpdef void give_way(PsiColumns psi, Candidates candidates, EdgeColumns edges, CircleColumns rebel, ImagePlane plane, double margin_px) noexcept nogil
