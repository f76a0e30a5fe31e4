"""The lens: positions of the input frame to those of an ideal pinhole, and back.

Distortion is removed from the corners, not from the image. The models are those of OpenCV: with a ray's
x/z, y/z and r = √(x² + y²),

- radial-tangential (k1, k2, p1, p2[, k3]): r ↦ r(1 + k1 r² + k2 r⁴ + k3 r⁶), then decentring by p1, p2;
- equidistant (k1, k2, k3, k4): θ = arctan r ↦ θ(1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Camera
from lcf_edge.errors import ConfigError
from lcf_edge.image_limit import MAX_PIXELS

Points = npt.NDArray[np.float32]
"""(n, 2) positions x, y in px, pixel centres at whole numbers."""

_Floats = npt.NDArray[np.float64]

WIDEST, NARROWEST = 200, 1000  # largest focal length in image sides; largest side in focal lengths
FARTHEST_MIDDLE = 10  # from the principal point to the image, in sides
MAX_COEFFICIENT = 100.0

_MIN_COEFFICIENT = 1e-12  # less bends nothing, and has no root
_MAX_ANGLE_RAD = np.radians(85.0)  # off the optical axis: a plane image holds no more
_MIN_SLOPE = 0.1  # beyond, 1 px of corner noise would become 10 px; the fold, where it is 0, is near
_NEWTON_STEPS = 3  # a fixed number: a point's result must not depend on others
_TOLERANCE = 1e-4  # of x/z, y/z before the last step, which squares it to below 1e-3 px
_NODES = 2048  # of the radial inverse; its error is below 1e-4 px
_COEFFICIENTS = {"none": (0,), "radial-tangential": (4, 5), "equidistant": (4,)}


@dataclass(frozen=True)
class Lens:
    """Intrinsics of a camera for images of ``width`` × ``height`` px.

    ``fx``, ``fy``, ``cx``, ``cy``: px, pixel centres at whole numbers. A model that folds back, or looks over
    85° off the axis, is used up to there; positions beyond are NaN both ways. Raises ``ConfigError``.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: Literal["none", "radial-tangential", "equidistant"] = "none"
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.coefficients) not in _COEFFICIENTS[self.model]:
            counts = " or ".join(map(str, _COEFFICIENTS[self.model]))
            raise ConfigError(f"lens: {self.model} takes {counts} distortion coefficients")
        if not np.isfinite((self.fx, self.fy, self.cx, self.cy, *self.coefficients)).all():
            raise ConfigError("lens: intrinsics and distortion must be finite numbers")
        if min(self.fx, self.fy) <= 0:
            raise ConfigError("lens: focal lengths must be positive")
        if min(self.width, self.height) < 1 or self.width * self.height > MAX_PIXELS:
            raise ConfigError(f"lens: {self.width}x{self.height} is not an image size")
        side = max(self.width, self.height)
        if not side / WIDEST <= min(self.fx, self.fy) <= max(self.fx, self.fy) <= side * NARROWEST:
            raise ConfigError(f"lens: focal lengths must be {side / WIDEST:g} to {side * NARROWEST} px")
        if max(abs(self.cx), abs(self.cy)) > side * FARTHEST_MIDDLE:
            raise ConfigError(f"lens: its middle must be within {side * FARTHEST_MIDDLE} px")
        if any(abs(k) > MAX_COEFFICIENT for k in self.coefficients):
            raise ConfigError(f"lens: distortion coefficients must be within {MAX_COEFFICIENT:g}")

    @classmethod
    def from_config(cls, camera: Camera, width: int, height: int) -> "Lens":
        """The lens of ``camera`` for images of ``width`` × ``height`` px.

        Without intrinsics the field of view gives the focal length, and the axis meets the middle. Raises
        ``ConfigError``.
        """
        model, coefficients = camera.distortion_model, tuple(camera.distortion)
        if camera.intrinsics:
            fx, fy, cx, cy = camera.intrinsics
            return cls(camera.width, camera.height, fx, fy, cx, cy, model, coefficients).scaled(width, height)
        unit = cls(1, 1, 1.0, 1.0, 0.0, 0.0, model, coefficients)
        edge = unit.distort(np.array([[np.tan(camera.horizontal_fov_rad / 2), 0.0]], np.float32))[0, 0]
        if not edge > 0:
            raise ConfigError("camera.horizontal_fov_rad: wider than the distortion model reaches")
        focal = width / 2 / float(edge)
        return cls(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, model, coefficients)

    def scaled(self, width: int, height: int) -> "Lens":
        """The same lens for images of another size. Raises ``ConfigError`` when the aspect is another."""
        if (width, height) == (self.width, self.height):
            return self
        if abs(width * self.height - height * self.width) > max(self.width, self.height):  # 1 px of rounding
            raise ConfigError(
                f"camera.intrinsics: made for {self.width}x{self.height}, the images are {width}x{height}, "
                "another aspect; give camera.intrinsics, camera.width and camera.height of these images"
            )
        sx, sy = width / self.width, height / self.height
        cx, cy = (self.cx + 0.5) * sx - 0.5, (self.cy + 0.5) * sy - 0.5
        return Lens(width, height, self.fx * sx, self.fy * sy, cx, cy, self.model, self.coefficients)

    def distort(self, points: Points) -> Points:
        """Positions of the ideal pinhole (same fx, fy, cx, cy) → of the input frame; float32 (n, 2), px."""
        if not self.is_distorted:
            return points
        x, y = self._rays(points)
        s = x * x + y * y
        p1, p2 = self.decentring
        ray = self._ray(np.sqrt(s))
        gain = _poly(self.radial, ray * ray) + 2 * (p2 * x + p1 * y)
        if self.model == "equidistant":
            gain *= ray / np.sqrt(np.maximum(s, 1e-18))  # θ/r; 1 on the axis
        gain[ray > self.reach] = np.nan
        return self._pixels(x * gain + p2 * s, y * gain + p1 * s)

    def distort_xy(self, x: Any, y: Any) -> tuple[Any, Any]:
        """``distort`` of positions given as two arrays, float32 (n,) px each."""
        if not self.is_distorted:
            return x, y
        placed = self.distort(np.stack((x, y), axis=1))
        return placed[:, 0], placed[:, 1]

    def undistort(self, points: Points) -> Points:
        """Positions of the input frame → of the ideal pinhole (same fx, fy, cx, cy); float32 (n, 2), px.

        The inverse of ``distort``: its radial part by a table, polished by Newton steps where the model has
        decentring.
        """
        if not self.is_distorted:
            return points
        xd, yd = self._rays(points)
        radius = np.sqrt(xd * xd + yd * yd)
        bent, gains = self._inverse
        gain = np.interp(radius, bent, gains, right=np.nan)
        x, y = xd * gain, yd * gain
        if any(self.decentring):
            x, y = self._polish(x, y, xd, yd)
        return self._pixels(x, y)

    def undistort_pixels(self, x: npt.NDArray[np.integer[Any]], y: npt.NDArray[np.integer[Any]]) -> Points:
        """``undistort`` of whole pixels inside the frame, from a table made at first use.

        ``x``, ``y``: (n,) integers. The table takes 8 bytes a pixel (2.5 MB at 640×480).
        """
        if not self.is_distorted:
            points = np.empty((len(x), 2), np.float32)
            points[:, 0], points[:, 1] = x, y
            return points
        return self._table.take(y.astype(np.intp) * self.width + x, axis=0)

    def bearing(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Direction of positions of the ideal pinhole, px (numbers or arrays), against the optical axis.

        Bearing, rad, right positive, and elevation over the plane of the camera's x and z, rad, up positive.
        """
        right, down = (x - self.cx) / self.fx, (y - self.cy) / self.fy
        return np.arctan(right), np.arctan2(-down, np.sqrt(1 + right * right))

    @cached_property
    def is_distorted(self) -> bool:
        """Whether positions differ from those of the pinhole at all."""
        return self.model == "equidistant" or any(self.coefficients)

    @cached_property
    def matrix(self) -> npt.NDArray[np.float64]:
        """K, (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @cached_property
    def radial(self) -> tuple[float, ...]:
        """Coefficients 1, k1, k2, … of the radial polynomial's gain."""
        decentring = slice(2, 4) if self.model == "radial-tangential" else slice(0, 0)
        return (1.0, *np.delete(self.coefficients, decentring).tolist())

    @cached_property
    def decentring(self) -> tuple[float, float]:
        """p1, p2."""
        if self.model != "radial-tangential":
            return 0.0, 0.0
        return self.coefficients[2], self.coefficients[3]

    @cached_property
    def reach(self) -> float:
        """Largest r (radial-tangential) or θ (equidistant, rad) that the model maps usefully."""
        slope = [(2 * i + 1) * k for i, k in enumerate(self.radial)]  # of ρ, as a polynomial of r² or θ²
        slope[0] -= _MIN_SLOPE
        slope = [k if abs(k) >= _MIN_COEFFICIENT else 0.0 for k in slope]
        roots = np.roots(slope[::-1])
        folds = np.sqrt(roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)])
        return float(min(self._ray(np.tan(_MAX_ANGLE_RAD)), *folds, np.inf))

    @cached_property
    def _inverse(self) -> tuple[_Floats, _Floats]:
        """Return distorted radii, ascending, and the factors that turn them into r."""
        equidistant = self.model == "equidistant"
        angles = np.linspace(1e-6, self.reach if equidistant else np.arctan(self.reach), _NODES)
        r = np.tan(angles)
        ray = angles if equidistant else r
        bent = ray * _poly(self.radial, ray * ray)
        return bent, r / bent

    @cached_property
    def _table(self) -> Points:
        """Return ``undistort`` of every pixel; made row by row to save memory."""
        table = np.empty((self.height, self.width, 2), np.float32)
        row = np.zeros((self.width, 2), np.float32)
        row[:, 0] = np.arange(self.width)
        for y in range(self.height):
            row[:, 1] = y
            table[y] = self.undistort(row)
        return table.reshape(-1, 2)

    def _ray(self, r: Any) -> Any:
        return np.arctan(r) if self.model == "equidistant" else r

    def _polish(self, x: _Floats, y: _Floats, xd: _Floats, yd: _Floats) -> tuple[_Floats, _Floats]:
        """Newton's method on the radial-tangential model, whose Jacobian is symmetric; NaN where it fails."""
        p1, p2 = self.decentring
        slopes = tuple(2 * i * k for i, k in enumerate(self.radial))[1:]
        for _ in range(_NEWTON_STEPS):
            s = x * x + y * y
            gain = _poly(self.radial, s) + 2 * (p2 * x + p1 * y)
            ex, ey = x * gain + p2 * s - xd, y * gain + p1 * s - yd
            slope = _poly(slopes, s)
            xx = gain + x * x * slope + 4 * p2 * x
            xy = x * y * slope + 2 * (p1 * x + p2 * y)
            yy = gain + y * y * slope + 4 * p1 * y
            determinant = xx * yy - xy * xy
            x, y = x - (yy * ex - xy * ey) / determinant, y - (xx * ey - xy * ex) / determinant
        x[(np.abs(ex) + np.abs(ey) > _TOLERANCE) | (s > self.reach**2)] = np.nan
        return x, y

    def _rays(self, points: Points) -> tuple[_Floats, _Floats]:
        x, y = points.astype(np.float64).T
        return (x - self.cx) / self.fx, (y - self.cy) / self.fy

    def _pixels(self, x: _Floats, y: _Floats) -> Points:
        points = np.empty((len(x), 2), np.float32)
        points[:, 0] = x * self.fx + self.cx
        points[:, 1] = y * self.fy + self.cy
        return points


def _poly(coefficients: tuple[float, ...], s: _Floats) -> _Floats:
    """c0 + c1 s + c2 s² + … by Horner's rule."""
    value = np.full_like(s, coefficients[-1])
    for c in coefficients[-2::-1]:
        value *= s
        value += c
    return value
