cimport cython
from libc cimport math
from lcf_edge.filter.columns cimport CircleColumns, ObjectColumns, PsiColumns
from lcf_edge.filter.image_plane cimport ImagePlane, project

cdef double NAN
cdef double INF
cdef int REBEL
cdef int MAX_SUPPORT
cdef double BEARING_SHARE
cdef int X
cdef int Y

cdef class Records:
    cdef public int count
    cdef object record, array, owners
    cdef unsigned int[:, ::1] words
    cdef float[:, ::1] floats
    cdef unsigned int[::1] owner

    cpdef written(self)
    cpdef written_owners(self)

cdef bint place(Records records, ImagePlane plane, double x, double y) noexcept nogil
cdef double right_of_axis(ImagePlane plane, double x) noexcept nogil
cdef double elevation(ImagePlane plane, double right, double y) noexcept nogil
@cython.locals(i=cython.Py_ssize_t, n=int, square=int, support=cython.uint, owned=bint, right=double)
cpdef void add_circles(Records records, CircleColumns table, ObjectColumns objects, int kind, ImagePlane plane,
                       double min_trust) noexcept
@cython.locals(i=cython.Py_ssize_t, n=int, support=cython.uint, right=double, slant=double, down=double)
cpdef void add_objects(Records records, ObjectColumns table, ImagePlane plane, double min_trust) noexcept
@cython.locals(i=cython.Py_ssize_t, n=int)
cpdef void add_psi(Records records, PsiColumns table, ImagePlane plane) noexcept
