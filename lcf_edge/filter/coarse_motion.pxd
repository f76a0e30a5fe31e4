cimport cython
from libc cimport math
from lcf_edge.filter cimport block_matching, flow, image_plane, lengths, path, rounding, situation
from lcf_edge.filter.baselines cimport Baselines
from lcf_edge.filter.block_matching cimport Blocks
from lcf_edge.filter.flow cimport Homography, Pinhole
from lcf_edge.filter.image_plane cimport ImagePlane
from lcf_edge.filter.key_frames cimport KeyFrames
from lcf_edge.filter.situation cimport Situation

cdef int KEYS
cdef double REACH_SHARE
cdef double DOWN_SHARE
cdef double NEAREST_M
cdef double ANY_WAY_M
cdef double OFF_FLOW
cdef double ROTATION_SIGMAS
cdef double TURN_SIGMAS
cdef double MAX_OFF_FLOW
cdef double PLAIN_GREY
cdef double CALM_GREY
cdef double BESIDE_PX
cdef double LIKENESS
cdef int RING
cdef double RING_LIKENESS
cdef double RING_GREY
cdef double STAYS_PX
cdef int MAX_SEEN
cdef int MAX_SEARCHES
cdef double SLOW_S
cdef double MIN_SLOW_S
cdef double SAME_SMALL_PX
cdef double SAME_SHARE
cdef double GROUND_MARGIN
cdef int LAST
cdef int OLDER
cdef int UNKNOWN
cdef int STANDS
cdef int CHANGED
cdef int WORST

cdef class CoarseMotion:
    cdef readonly Blocks blocks
    cdef int side, columns, rows
    cdef double[:, :, ::1] turned
    cdef Homography back
    cdef double then_s, ahead_m, focus_x, focus_y, off_flow, base_x, base_y, share
    cdef int seen, searches, here, across, down, least_still, least_moving
    cdef const double[::1] x, y
    cdef int[::1] links, links_before, stance
    cdef double[::1] came_x, came_y, vx_before, vy_before
    cdef double[:, ::1] shares
    cdef double[::1] vx, vy, elapsed_s, contact_s

@cython.locals(i=int, j=int)
cpdef void take(CoarseMotion coarse, const unsigned char[::1] small) noexcept nogil
@cython.locals(i=int, j=int)
cpdef void turn(CoarseMotion coarse, const double[:, :, ::1] rotation) noexcept nogil
@cython.locals(i=int, j=int)
cdef void turn_back(CoarseMotion coarse, Pinhole pinhole, const double[:, :, ::1] rotation, int k, KeyFrames keys) noexcept nogil
cdef void look_back(CoarseMotion coarse, KeyFrames keys, Situation around) noexcept nogil
cdef void look_farther_back(CoarseMotion coarse, int slot, KeyFrames keys, Baselines baselines, Situation around) noexcept nogil
@cython.locals(k=int, oldest=int, most=double)
cdef int older_slot(CoarseMotion coarse, Baselines baselines) noexcept nogil
cdef int calm(CoarseMotion coarse, int k) noexcept nogil
cdef int nearest_px(double x) noexcept nogil
cdef int difference(CoarseMotion coarse, int x, int y, int most) noexcept nogil
@cython.locals(x=int, y=int, most=int)
cdef bint stands_as_lately(CoarseMotion coarse, int k, double end_x, double end_y) noexcept nogil
@cython.locals(x=int, y=int, beside=int, level=bint, steps=int, step=int, off=int, along_x=int, along_y=int, at_x=int, at_y=int, total=int)
cdef void seek_standing(CoarseMotion coarse, int k, double end_x, double end_y, double off_flow) noexcept nogil
cdef double off_segment(double x, double y, double end_x, double end_y) noexcept nogil
@cython.locals(x=int, y=int, total=int)
cdef void try_moving(CoarseMotion coarse, int across, int down, double end_x, double end_y, double off_flow) noexcept nogil
@cython.locals(reach=int, reach_down=int, across=int, down=int, middle_x=int, middle_y=int)
cdef void seek_moving(CoarseMotion coarse, double end_x, double end_y, double off_flow) noexcept nogil
@cython.locals(x=int, y=int, most=int, across=int, down=int, on_ring=bint)
cdef bint is_distinct(CoarseMotion coarse) noexcept nogil
@cython.locals(highest=int)
cdef double finer(int before, int middle, int after) noexcept nogil
@cython.locals(x=int, y=int, middle=int, left=int, top=int)
cdef bint set_motion(CoarseMotion coarse, int k) noexcept nogil
cdef bint are_alike(CoarseMotion coarse, double vx, double vy, double other_vx, double other_vy) noexcept nogil
@cython.locals(column=int, row=int, r=int, c=int, b=int)
cdef void chain(CoarseMotion coarse, int k, double dt_s) noexcept nogil
@cython.locals(left=int, top=int)
cdef bint put(CoarseMotion coarse, int k, ImagePlane plane) noexcept nogil
@cython.locals(moves=bint)
cdef bint see(CoarseMotion coarse, int k, int age, Situation around) noexcept nogil
cdef double farthest_share(CoarseMotion coarse, int k, Situation around) noexcept nogil
@cython.locals(x=int, y=int, far=int, near=int, step=int, along_x=int, along_y=int, total=int)
cdef bint may_be_near(CoarseMotion coarse, double way_x, double way_y, double way, int steps, double far_px) noexcept nogil
@cython.locals(fits=bint, x=int, y=int, beside=int, nearest=int, level=bint, steps=int, step=int, off=int, along_x=int, along_y=int, across=int, down=int, total=int)
cdef double seek_near(CoarseMotion coarse, int k, double off_flow, double farthest) noexcept nogil
cdef bint is_in_way(CoarseMotion coarse, int k, double range_m, Situation around) noexcept nogil
@cython.locals(k=int, known=bint)
cdef void seek_all_near(CoarseMotion coarse, ImagePlane plane, Situation around) noexcept nogil
@cython.locals(k=int, back=int, pieces=int, known=bint, is_measured=bint)
cdef void see_all(CoarseMotion coarse, int age, ImagePlane plane, Situation around) noexcept nogil
@cython.locals(k=int, slot=int)
cpdef void measure(CoarseMotion coarse, KeyFrames keys, Baselines baselines, ImagePlane plane, Situation around) noexcept nogil
