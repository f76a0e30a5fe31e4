cimport cython
from libc cimport math
from lcf_edge.filter cimport image_plane, matching
from lcf_edge.filter.columns cimport CircleColumns, CornerColumns, EdgeColumns, GroupColumns, PsiColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.matching cimport CornerIndex
from lcf_edge.filter.settings cimport Settings

cdef double MISSING_SHARE
cdef double NEW_SHARE
cdef int SPARE_CORNERS
cdef int CIRCLE_SHAPE

cdef bint holds(PsiColumns psi, Py_ssize_t p, double x, double y) noexcept nogil
cpdef int psi_at(PsiColumns psi, double x, double y) noexcept nogil
cpdef void list_live(PsiColumns psi) noexcept nogil
@cython.locals(seen=bint, beside=bint)
cpdef bint coincides(CornerIndex index, ImagePlane plane, CornerColumns corners, double x, double y, double reach_px) noexcept nogil
cdef void place_in_psi(PsiColumns psi, CornerIndex index, ImagePlane plane, EdgeColumns edges, CornerColumns corners, double reach_px) noexcept nogil
cpdef void end_surprised(PsiColumns psi) noexcept nogil
cdef void hold(EdgeColumns edges, PsiColumns psi, int key_number, double tr_s) noexcept nogil
cpdef int omit(PsiColumns psi, CornerIndex index, ImagePlane plane, EdgeColumns edges, CornerColumns corners, int key_number, Settings settings) noexcept nogil
@cython.locals(full=bint, k=Py_ssize_t)
cdef bint insert_group(GroupColumns groups, CircleColumns circles, Py_ssize_t c, int row) noexcept nogil
cdef void copy_group(GroupColumns groups, Py_ssize_t source, Py_ssize_t target) noexcept nogil
cpdef int collect(GroupColumns groups, CircleColumns normal, CircleColumns rebel, double tr_cr) noexcept nogil
cpdef int group_at(GroupColumns groups, double x, double y) noexcept nogil
cpdef int circle_at(GroupColumns groups, double x, double y) noexcept nogil
