"""Projection from the ideal pinhole through the lens into the input frame, one position at a time."""

import math

from lcf_edge.lens import Lens

NAN = float("nan")
MIN_RADIUS = 1e-9  # of a ray, in x/z and y/z; nearer to the axis the lens changes nothing


class ImagePlane:
    """The input frame and lens model (see ``lens``). ``u``, ``v``: result of ``project``, px."""

    def __init__(self, lens: Lens) -> None:
        self.width, self.height = lens.width, lens.height
        self.fx, self.fy, self.cx, self.cy = lens.fx, lens.fy, lens.cx, lens.cy
        self.is_distorted, self.is_equidistant = lens.is_distorted, lens.model == "equidistant"
        self.k1, self.k2, self.k3, self.k4 = (*lens.radial, 0.0, 0.0, 0.0, 0.0)[1:5]
        self.p1, self.p2 = lens.decentring
        self.reach = lens.reach
        self.u = self.v = 0.0


def distort(plane: ImagePlane, x: float, y: float) -> None:
    """Distort a position of the ideal pinhole into ``u``, ``v``, px; NaN beyond the reach of the lens model."""
    x = (x - plane.cx) / plane.fx
    y = (y - plane.cy) / plane.fy
    s = x * x + y * y
    r = math.sqrt(s)
    ray = math.atan(r) if plane.is_equidistant else r  # θ, or r
    if not ray <= plane.reach:
        plane.u = plane.v = NAN
        return
    q = ray * ray
    gain = 1 + q * (plane.k1 + q * (plane.k2 + q * (plane.k3 + q * plane.k4))) + 2 * (plane.p2 * x + plane.p1 * y)
    if plane.is_equidistant:
        gain *= ray / max(r, MIN_RADIUS)  # θ/r; the principal point stays where it is
    plane.u = (x * gain + plane.p2 * s) * plane.fx + plane.cx
    plane.v = (y * gain + plane.p1 * s) * plane.fy + plane.cy


def project(plane: ImagePlane, x: float, y: float) -> bool:
    """Project a position of the ideal pinhole into ``u``, ``v``, px; return whether it is in the image."""
    plane.u, plane.v = x, y
    if plane.is_distorted:
        distort(plane, x, y)
    return 0 <= plane.u <= plane.width - 1 and 0 <= plane.v <= plane.height - 1
