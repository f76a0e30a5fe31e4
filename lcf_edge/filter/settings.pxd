cdef class Settings:
    cdef readonly double tr_cr, tr_s, tr_max, tr_new, delta_px, bl0_px, leap_px, bs_px
    cdef double tr_coast, bl_min_px
    cdef readonly double scene_depth_m
    cdef double appearance_max, appearance_share, key_interval_s, key_motion_px
    cdef readonly double eps_beta_rad
    cdef double eps_v, eps_beta_rebel_rad, eps_v_rebel, eps_beta_circle_rebel_rad
    cdef readonly double involvement, rebel_link_px
    cdef double eps_v_circle_rebel, rebel_share
    cdef readonly double pitch_sigma_rad, psi_life_s
    cdef double ground_margin
    cdef readonly double psi_margin_px
    cdef double neighbour_px, member_margin_px, min_coast_px
    cdef readonly int circle_support, rebel_support
