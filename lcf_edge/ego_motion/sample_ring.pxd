cimport cython
from libc cimport math

cdef long long MAX_STAMP_NS
cdef int RESTART_AFTER
cdef int PERIODS
cdef int MIN_ROWS
cdef double INF

cdef stamps(Py_ssize_t capacity)

cdef class Span:
    cdef readonly long long start_ns, end_ns
    cdef readonly double dt_s

cdef class Track:
    cdef readonly Py_ssize_t count, columns
    cdef double[::1] times_s
    cdef double[:, ::1] values

    @cython.locals(last=cython.Py_ssize_t, i=cython.Py_ssize_t, k=cython.Py_ssize_t, whole_s=cython.double,
                   step_s=cython.double, total=cython.double)
    cpdef list mean(self)
    @cython.locals(i=cython.Py_ssize_t, w=cython.double, x=cython.double, y=cython.double, z=cython.double,
                   c=cython.double, s=cython.double, a=cython.double, b=cython.double, d=cython.double,
                   rx=cython.double, ry=cython.double, rz=cython.double, angle=cython.double, dt_s=cython.double,
                   scale=cython.double)
    cpdef turn(self, double error_x, double error_y, double error_z, double[:, ::1] rotation)
    @cython.locals(k=cython.Py_ssize_t)
    cpdef hold(self, double dt_s, values)

cdef class Window:
    cdef readonly Py_ssize_t first, last

cdef class Ring:
    cdef public long long used_ns
    cdef readonly Py_ssize_t count, capacity, columns
    cdef str sensor
    cdef object refused
    cdef long long[::1] stamps_ns
    cdef double[:, ::1] values
    cdef int behind
    cdef long long behind_ns
    cdef long long[::1] periods_ns

    cpdef refuse(self, str reason, Py_ssize_t count=*)
    @cython.locals(k=cython.Py_ssize_t)
    cpdef add(self, stamp_ns, values)
    cdef bint is_behind(self, long long stamp_ns)
    @cython.locals(leaving=cython.Py_ssize_t, missed=cython.Py_ssize_t, i=cython.Py_ssize_t, k=cython.Py_ssize_t)
    cdef make_room(self)
    @cython.locals(low=cython.Py_ssize_t, high=cython.Py_ssize_t, middle=cython.Py_ssize_t)
    cdef Py_ssize_t after(self, long long stamp_ns) noexcept
    @cython.locals(i=cython.Py_ssize_t)
    cpdef double age_s(self, long long now_ns)
    @cython.locals(n=cython.Py_ssize_t, i=cython.Py_ssize_t, k=cython.Py_ssize_t, row=cython.Py_ssize_t,
                   period_ns=cython.longlong)
    cpdef double period_s(self)
    @cython.locals(before_ns=cython.longlong, beyond_ns=cython.longlong)
    cpdef bint covers(self, Span span, double gap_limit_s)
    @cython.locals(first=cython.Py_ssize_t, last=cython.Py_ssize_t, held_ns=cython.longlong)
    cpdef double held_s(self, Span span)
    @cython.locals(first=cython.Py_ssize_t, last=cython.Py_ssize_t, i=cython.Py_ssize_t, gap_ns=cython.longlong)
    cpdef double gap_s(self, Span span, double gap_limit_s)
    @cython.locals(first=cython.Py_ssize_t, last=cython.Py_ssize_t, i=cython.Py_ssize_t, k=cython.Py_ssize_t)
    cpdef between(self, Span span, Track track)
    @cython.locals(k=cython.Py_ssize_t, before_ns=cython.longlong, share=cython.double)
    cdef void interpolate(self, long long stamp_ns, Py_ssize_t i, Track track, Py_ssize_t row) noexcept
    @cython.locals(start_ns=cython.longlong, i=cython.Py_ssize_t)
    cpdef bint find_latest(self, Window window, long long now_ns, long long length_ns, double gap_limit_s)
    @cython.locals(count=cython.Py_ssize_t, i=cython.Py_ssize_t, k=cython.Py_ssize_t)
    cpdef Py_ssize_t repeats(self, Window window, Py_ssize_t begin, Py_ssize_t end)
    @cython.locals(most=cython.double, i=cython.Py_ssize_t)
    cpdef double largest(self, Window window, Py_ssize_t column)
    @cython.locals(total=cython.double, i=cython.Py_ssize_t, k=cython.Py_ssize_t)
    cpdef list average(self, Py_ssize_t first, Py_ssize_t last)
    @cython.locals(mean=cython.double, total=cython.double, i=cython.Py_ssize_t, k=cython.Py_ssize_t)
    cpdef list deviation(self, Window window, means)
    @cython.locals(k=cython.Py_ssize_t)
    cpdef list newest(self, Window window)
