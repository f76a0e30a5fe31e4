"""Rotation of the camera between two images, from the images alone.

Phase correlation of downscaled, high-pass filtered images finds the shift that most of the image shares, however large.
Near and moving objects shift differently from the rest, and not alike. Accurate to a few pixels, which is enough to
match corners. No clock, no I/O.
"""

from dataclasses import dataclass
from math import hypot, pi

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.lens import Lens
from lcf_edge.small_image import SmallImage

Grey = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]

_LEVEL_PX = 9  # width of the high-pass filter
_MIN_CONTRAST = 1.0  # grey levels, 1 sigma of a downscaled image: a plain one shows no shift
_MIN_RESPONSE = 0.3  # share of the correlation in its peak
_SIGMA_PX = 0.35  # 1 sigma of the shift of downscaled images
_SIGMA_SHARE = 0.03  # 1 sigma as a share of the shift: roll, and the image's corners
_ROLL_SIGMA_RAD = pi  # unknown
_STEP_RAD = 1e-3
_GRID = 24
_MIN_GAIN_PX = 1.0  # px a rad; no real lens gives less


@dataclass(frozen=True, slots=True)
class Turn:
    """``turn_rad``: rotation vector (3,) of directions in camera axes; ``sigma_rad``: (3,), 1 sigma."""

    turn_rad: Floats
    sigma_rad: Floats

    @property
    def rotation(self) -> Floats:
        """(3, 3), as in ``EgoMotion``."""
        matrix, _ = cv2.Rodrigues(self.turn_rad)
        return np.asarray(matrix, np.float64)


class ImageRotation:
    """For images of one size and ``lens``. ``sigma_rad``: of pitch and yaw at best."""

    def __init__(self, lens: Lens) -> None:
        self._before: npt.NDArray[np.float32] | None = None
        small = SmallImage(lens.width, lens.height)
        self._window = np.outer(np.hanning(small.height), np.hanning(small.width)).astype(np.float32)
        self._px_per_rad = _gain(lens) / small.side
        self.sigma_rad = _SIGMA_PX / float(self._px_per_rad.min())

    def forget(self) -> None:
        """Forget the last image: the next one does not follow it."""
        self._before = None

    def turn(self, small: Grey) -> Turn | None:
        """Return the rotation from the last image to this downscaled one; None: they do not show it."""
        before, self._before = self._before, _levelled(small)
        if before is None or self._before is None:
            return None
        (right_px, down_px), response = cv2.phaseCorrelate(before, self._before, self._window)
        if not response >= _MIN_RESPONSE:
            return None
        yaw_gain, pitch_gain = self._px_per_rad.tolist()
        sigma_px = _SIGMA_PX + _SIGMA_SHARE * hypot(right_px, down_px)
        return Turn(
            np.array([-down_px / pitch_gain, right_px / yaw_gain, 0.0]),
            np.array([sigma_px / pitch_gain, sigma_px / yaw_gain, _ROLL_SIGMA_RAD]),
        )


def _levelled(small: Grey) -> npt.NDArray[np.float32] | None:
    """Return a high-pass filtered image; None: it is plain."""
    level = small.astype(np.float32)
    level -= cv2.blur(level, (_LEVEL_PX, _LEVEL_PX))
    return level if cv2.norm(level) > _MIN_CONTRAST * level.size**0.5 else None


def _gain(lens: Lens) -> Floats:
    """Return the shift in the middle of the image, px: to the right for 1 rad about y, up for 1 rad about x."""
    x, y = np.meshgrid(np.linspace(0, lens.width - 1, _GRID), np.linspace(0, lens.height - 1, _GRID))
    weight = np.outer(np.hanning(_GRID), np.hanning(_GRID)).ravel() ** 2
    placed = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)
    u, v = ((lens.undistort(placed) - (lens.cx, lens.cy)) / (lens.fx, lens.fy)).T.astype(np.float64)
    yawed = np.stack([u + _STEP_RAD * (1 + u * u), v + _STEP_RAD * u * v], axis=1)
    pitched = np.stack([u - _STEP_RAD * u * v, v - _STEP_RAD * (1 + v * v)], axis=1)
    gains = []
    for moved, axis, sign in ((yawed, 0, 1), (pitched, 1, -1)):
        there = lens.distort((moved * (lens.fx, lens.fy) + (lens.cx, lens.cy)).astype(np.float32))
        shift = sign * (there - placed)[:, axis] / _STEP_RAD
        seen = np.isfinite(shift)
        total = float(weight[seen].sum())
        gain = float(shift[seen] @ weight[seen]) / total if total > 0 else lens.fx
        gains.append(max(gain, _MIN_GAIN_PX))
    return np.array(gains)
