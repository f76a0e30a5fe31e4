cimport cython
from libc cimport math
from lcf_edge.filter cimport circles as shared
from lcf_edge.filter cimport edge_expert, image_plane, lengths, object_belief, object_prediction, rebel_circles, turmoil
from lcf_edge.filter.circles cimport Ids
from lcf_edge.filter.columns cimport CircleColumns, EdgeColumns, ObjectColumns
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.settings cimport Settings
from lcf_edge.filter.situation cimport Situation

cdef double LEFT_SHARE
cdef int UNKNOWN
cdef int STANDING
cdef int CROSSING
cdef int LEADING
cdef int CUTTING_IN
cdef int CROSSES
cdef int COMES
cdef int LEADS
cdef int SEEN
cdef double INFINITY

cdef bint is_due(ObjectColumns objects, Py_ssize_t o, Settings settings) noexcept nogil
cdef bint is_doubtful(ObjectColumns objects, Py_ssize_t o) noexcept nogil
cdef bint is_sure(ObjectColumns objects, Py_ssize_t o, Settings settings) noexcept nogil
cdef int cause_of(ObjectColumns objects, Py_ssize_t o) noexcept nogil
@cython.locals(o=Py_ssize_t)
cdef void correct(ObjectColumns objects, CircleColumns circles, Settings settings) noexcept nogil
cdef bint is_inside(CircleColumns circles, Py_ssize_t c, ObjectColumns objects, Py_ssize_t o) noexcept nogil
@cython.locals(is_trusted=bint)
cdef bint is_shown(ObjectColumns objects, Py_ssize_t o, CircleColumns circles, Settings settings) noexcept nogil
@cython.locals(c=int, own=int)
cdef int own_circle(CircleColumns circles, Py_ssize_t o) noexcept nogil
@cython.locals(x=double, y=double, looming=double, vx=double, vy=double, reach=double)
cdef void show(ObjectColumns objects, Py_ssize_t o, CircleColumns circles, Py_ssize_t c, Situation around, Settings settings) noexcept nogil
@cython.locals(inward=double, inmost_x=double)
cdef bint has_left(ObjectColumns objects, Py_ssize_t o, ImagePlane plane) noexcept nogil
@cython.locals(ended=int, o=int)
cdef void end_outside(ObjectColumns objects, CircleColumns circles, EdgeColumns edges, ImagePlane plane, Situation around) noexcept nogil
@cython.locals(o=Py_ssize_t, c=int)
cpdef void update(ObjectColumns objects, CircleColumns circles, EdgeColumns edges, ImagePlane plane, Situation around, Settings settings, Ids ids) noexcept nogil
cpdef void join_rebels(EdgeColumns edges, Py_ssize_t start, CircleColumns circles, ObjectColumns objects, Situation around, Settings settings) noexcept nogil
