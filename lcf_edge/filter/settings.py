"""The keys of ``filter`` for the loops; meanings and units as in the configuration."""

import math

from lcf_edge.config import Filter
from lcf_edge.filter.flow import Pinhole

REFERENCE_FOCAL_PX = 320 / math.tan(0.525)  # of the camera to which px in the configuration refer: 640 px over 1.05 rad
NEIGHBOUR_PX = 40.0  # edges nearer than this, at the same depth, are judged together
MEMBER_MARGIN_PX = 8.0  # around a rebel circle, within which edges may belong to it
MIN_COAST_PX = 40.0  # a circle so near that it grows too fast to be tracked is at least this large
PSI_MARGIN_PX = 12.0  # kept between ψ and anything that breaks the flow
# Lower bounds: however few px a radian has, corners lie some px apart.
MIN_LINK_PX = 12.0
MIN_CIRCLE_PX = 14.0
MIN_NEIGHBOUR_PX = 11.0  # and are a px off: over less, a shift that they share may be an approach
MIN_MEMBER_MARGIN_PX = 3.0
MIN_MIN_COAST_PX = 15.0
MIN_PSI_MARGIN_PX = 5.0


class Settings:
    """Constants of the filter. ``tr_new``: Tr of everything new, ½(Tr_cr + Tr_s). ``tr_coast``: Tr from which what
    grows too fast for its corners to be tracked goes on without them, ½(Tr_s + Tr_max).

    Sizes and angles of the world are px of ``pinhole``: the configuration gives them at a focal length of
    ``REFERENCE_FOCAL_PX``, so that they hold for every image size and lens. Gates and noise of corners are px of the
    image, whatever its size.
    """

    def __init__(self, settings: Filter, pinhole: Pinhole) -> None:
        scale = pinhole.focal / REFERENCE_FOCAL_PX
        self.tr_cr, self.tr_s, self.tr_max = settings.tr_cr, settings.tr_s, settings.tr_max
        self.tr_new = 0.5 * (settings.tr_cr + settings.tr_s)
        self.tr_coast = 0.5 * (settings.tr_s + settings.tr_max)
        self.delta_px = settings.delta_px
        self.bl0_px, self.bl_min_px, self.leap_px = settings.bl0_px, settings.bl_min_px, settings.leap_px
        self.bs_px, self.scene_depth_m = max(settings.bs_px * scale, MIN_CIRCLE_PX), settings.scene_depth_m
        self.appearance_max, self.appearance_share = settings.appearance_max, settings.appearance_share
        self.key_interval_s, self.key_motion_px = settings.key_interval_s, settings.key_motion_px
        self.eps_beta_rad, self.eps_v = settings.eps_beta_rad, settings.eps_v
        self.eps_beta_rebel_rad, self.eps_v_rebel = settings.eps_beta_rebel_rad, settings.eps_v_rebel
        self.eps_beta_circle_rebel_rad = settings.eps_beta_circle_rebel_rad
        self.eps_v_circle_rebel = settings.eps_v_circle_rebel
        self.involvement, self.rebel_share = settings.involvement, settings.rebel_share
        self.circle_support, self.rebel_support = settings.circle_support, settings.rebel_support
        self.rebel_link_px = max(settings.rebel_link_px * scale, MIN_LINK_PX)
        self.neighbour_px = max(NEIGHBOUR_PX * scale, MIN_NEIGHBOUR_PX)
        self.member_margin_px = max(MEMBER_MARGIN_PX * scale, MIN_MEMBER_MARGIN_PX)
        self.min_coast_px = max(MIN_COAST_PX * scale, MIN_MIN_COAST_PX)
        self.psi_margin_px = max(PSI_MARGIN_PX * scale, MIN_PSI_MARGIN_PX)
        self.ground_margin = settings.ground_margin
        self.pitch_sigma_rad, self.psi_life_s = settings.pitch_sigma_rad, settings.psi_life_s
