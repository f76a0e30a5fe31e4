from lcf_edge.filter.columns cimport EdgeColumns

cdef int KEYS

cdef void copy_row(EdgeColumns edges, Py_ssize_t source, Py_ssize_t target) noexcept nogil
cdef void empty_row(EdgeColumns edges, Py_ssize_t i) noexcept nogil
cpdef void remove(EdgeColumns edges, unsigned char[::1] dead) noexcept nogil
