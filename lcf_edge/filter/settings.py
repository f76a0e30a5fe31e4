"""The keys of ``filter`` as the loops take them; meanings and units as in the configuration."""

from lcf_edge.config import Filter


class Settings:
    """Constants of the filter. ``tr_new``: Tr of everything new, ½(Tr_cr + Tr_s)."""

    def __init__(self, settings: Filter) -> None:
        self.tr_cr, self.tr_s, self.tr_max = settings.tr_cr, settings.tr_s, settings.tr_max
        self.tr_new = 0.5 * (settings.tr_cr + settings.tr_s)
        self.delta_px, self.delta_rebel_px = settings.delta_px, settings.delta_rebel_px
        self.bl0_px, self.bl_min_px, self.leap_px = settings.bl0_px, settings.bl_min_px, settings.leap_px
        self.bs_px, self.scene_depth_m = settings.bs_px, settings.scene_depth_m
        self.appearance_max, self.appearance_share = settings.appearance_max, settings.appearance_share
        self.key_interval_s, self.key_motion_px = settings.key_interval_s, settings.key_motion_px
        self.eps_beta_rad, self.eps_v = settings.eps_beta_rad, settings.eps_v
        self.eps_beta_rebel_rad, self.eps_v_rebel = settings.eps_beta_rebel_rad, settings.eps_v_rebel
        self.eps_beta_circle_rebel_rad = settings.eps_beta_circle_rebel_rad
        self.eps_v_circle_rebel = settings.eps_v_circle_rebel
        self.involvement, self.rebel_share = settings.involvement, settings.rebel_share
        self.circle_support, self.rebel_support = settings.circle_support, settings.rebel_support
        self.rebel_link_px, self.edge_noise_px = settings.rebel_link_px, settings.edge_noise_px
        self.focus_sigma_px, self.ground_margin = settings.focus_sigma_px, settings.ground_margin
        self.pitch_sigma_rad, self.psi_life_s = settings.pitch_sigma_rad, settings.psi_life_s
