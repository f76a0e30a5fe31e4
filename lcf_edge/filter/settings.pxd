cdef class Settings:
    cdef readonly double tr_cr, tr_s, tr_max, tr_new, delta_px, delta_rebel_px, bl0_px, bl_min_px, leap_px, bs_px
    cdef readonly double scene_depth_m, appearance_max, appearance_share, key_interval_s, key_motion_px
    cdef readonly double eps_beta_rad, eps_v, eps_beta_rebel_rad, eps_v_rebel, eps_beta_circle_rebel_rad
    cdef readonly double eps_v_circle_rebel, involvement, rebel_share, rebel_link_px, edge_noise_px, focus_sigma_px
    cdef readonly double ground_margin, pitch_sigma_rad, psi_life_s
    cdef readonly double neighbour_px, member_margin_px, min_coast_px, psi_margin_px
    cdef readonly int circle_support, rebel_support
