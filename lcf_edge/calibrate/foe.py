"""The camera's mounting, from the focus of expansion of a straight drive, with rotation removed.

Each interval between images has its own rotation R; the direction of travel t is common to all. The ray x of a corner,
and x' after the interval, then satisfy the epipolar constraint x' · (t × R x) = 0. The distance from that line is
minimised over all intervals: for each t the rotations are the best-fitting ones, so only t's two slopes remain
(variable projection, Gauss-Newton, Cauchy weights). No gyro is used: its bias would shift the focus by degrees.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from drivers.samples import Frame
from lcf_edge.calibrate import report
from lcf_edge.calibrate.compare import lens_of
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.image_rotation import motion_field, turn
from lcf_edge.calibrate.result import CalibrationError, Result
from lcf_edge.calibrate.sources import SensorSource, for_a_while
from lcf_edge.calibrate.tracks import Tracker, Tracks
from lcf_edge.config import Config
from lcf_edge.lens import Lens

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]

LIVE_S = 20.0

_MIN_MOTION_PX = 4.0
_MAX_FRAMES = 5
_MIN_INTERVALS = 12
_MIN_PARALLAX_RAD = 0.004  # median flow that rotation does not explain; below, the vehicle is stationary
_STRAIGHT_RADPS = 0.06  # mean over _STRAIGHT_S
_STRAIGHT_S = 1.0
_MIN_STRAIGHT = 0.6  # of the intervals
_ITERATIONS = 12
_SCALE_SHARES = (8.0, 4.0, 2.0)  # scales of the robust fit, from coarse to fine
_MIN_SCALE = 1e-4
_MAX_SLOPE = 1.0  # of the direction of travel; beyond, it lies outside most images
_PIECES = 5
_MAX_SIGMA_RAD = np.radians(0.5)
_SETTLED = 1e-6


@dataclass(frozen=True)
class Focus:
    """The direction of travel, x/z and y/z of the camera, with 1 sigma of each, and the data behind it."""

    slope: Floats  # (2,)
    sigma: Floats  # (2,)
    place: Floats  # (n, 2) rays
    flow: Floats  # (n, 2) without rotation
    intervals: int
    left_out: int  # intervals in which the vehicle turned
    pieces: Floats  # (m, 2) slopes of parts of the drive

    @property
    def yaw_rad(self) -> float:
        """``camera.yaw_rad``."""
        return float(-np.arctan(self.slope[0]))

    @property
    def pitch_rad(self) -> float:
        """``camera.pitch_rad``."""
        return float(np.arctan(self.slope[1]))


def calibrate_foe(source: SensorSource, config: Config, seconds: float | None, guide: Guide) -> Result:
    """``camera.yaw_rad`` and ``camera.pitch_rad``. Raises ``CalibrationError``."""
    if source.live:
        seconds = seconds or LIVE_S
        guide.say(f"Drive straight ahead for {seconds:g} s, on level ground, past things that stand still.")
    tracker: Tracker | None = None
    lens: Lens | None = None
    tracked: list[Tracks] = []
    image = np.zeros((1, 1), np.uint8)
    for item in for_a_while(source.items(), seconds, Frame):
        if not isinstance(item, Frame):
            continue
        if tracker is None:
            lens, guessed = lens_of(source, config, item)
            if guessed:
                raise CalibrationError(
                    "camera.intrinsics: not known, and directions need them; run lcf-edge calibrate camera first"
                )
            tracker = Tracker(lens, _MIN_MOTION_PX, _MAX_FRAMES)
        image = item.image
        tracks = tracker.add(item)
        if tracks is not None:
            tracked.append(tracks)
        guide.progress(f"{len(tracked)} intervals with motion")
    guide.end()
    if lens is None:
        raise CalibrationError("camera: no images came; check camera.device, or name another recording")
    focus = find_focus(tracked)
    return _result(focus, lens, image, config)


def find_focus(tracked: Sequence[Tracks]) -> Focus:
    """The direction of travel of a straight drive. Raises ``CalibrationError``."""
    if len(tracked) < _MIN_INTERVALS:
        raise CalibrationError(
            f"camera: corners could be followed over {len(tracked)} intervals, {_MIN_INTERVALS} are needed; drive "
            "longer, with better light, past things with corners"
        )
    slope, rotations = _solve(tracked, np.zeros(2))
    straight = _straight(tracked, rotations)
    if np.mean(straight) < _MIN_STRAIGHT:
        raise CalibrationError(
            f"camera: the drive is not straight, it turned in {1 - np.mean(straight):.0%} of the time; drive straight "
            "ahead and keep your hands off the steering"
        )
    used = [tracks for tracks, is_straight in zip(tracked, straight, strict=True) if is_straight]
    if len(used) < len(tracked):
        slope, rotations = _solve(used, slope)
    place, flow = _derotated(used, rotations)
    parallax = float(np.median(np.hypot(*flow.T)))
    if parallax < _MIN_PARALLAX_RAD:
        raise CalibrationError(
            f"camera: hardly anything came nearer (median flow {np.degrees(parallax):.2f}° between images); drive "
            "faster, or past nearer things"
        )
    if np.abs(slope).max() > _MAX_SLOPE:
        raise CalibrationError("camera: no focus of expansion ahead; the camera must look ahead")
    if np.median(np.einsum("ni,ni->n", flow, place - slope)) < 0:
        raise CalibrationError("camera: the flow goes inwards, as when reversing; drive straight ahead")
    parts = np.array_split(np.arange(len(used)), _PIECES)
    pieces = np.array([_solve([used[row] for row in part], slope)[0] for part in parts])
    sigma = pieces.std(axis=0, ddof=1) / np.sqrt(_PIECES)
    if sigma.max() > _MAX_SIGMA_RAD:
        raise CalibrationError(
            f"camera: parts of the drive disagree by {np.degrees(sigma.max()):.1f}° (1 sigma, "
            f"{np.degrees(_MAX_SIGMA_RAD):.1f}° at most); drive straighter, longer, and past still things at "
            "several distances"
        )
    return Focus(slope, sigma, place, flow, len(used), len(tracked) - len(used), pieces)


def _straight(tracked: Sequence[Tracks], rotations: Sequence[Floats]) -> npt.NDArray[np.bool_]:
    """Return, (n,), whether the mean turning rate around each interval is small."""
    times_s = np.array([tracks.end_ns - tracked[0].start_ns for tracks in tracked]) * 1e-9
    lengths_s = np.array([tracks.dt_s for tracks in tracked])
    angles = np.array([cv2.Rodrigues(rotation)[0][1, 0] for rotation in rotations])
    near = np.abs(times_s[:, None] - times_s) <= _STRAIGHT_S / 2
    straight: npt.NDArray[np.bool_] = np.abs(near @ angles) < _STRAIGHT_RADPS * (near @ lengths_s)
    return straight


def _solve(used: Sequence[Tracks], slope: Floats) -> tuple[Floats, list[Floats]]:
    """Slopes of the direction of travel (2,), and the rotation of each interval (3, 3)."""
    travel = np.append(slope, 1.0)
    rotations = [_rotation(-turn(tracks, travel).rate_radps * tracks.dt_s) for tracks in used]
    for iteration in range(_ITERATIONS):
        share = _SCALE_SHARES[min(iteration // 2, len(_SCALE_SHARES) - 1)]
        normal, right = np.zeros((2, 2)), np.zeros(2)
        parts = []
        for tracks, rotation in zip(used, rotations, strict=True):
            by_slope, by_rotation, errors = _linearised(tracks, rotation, slope)
            scale = max(1.4826 * float(np.median(np.abs(errors))), _MIN_SCALE)
            weights = 1 / (1 + (errors / (share * scale)) ** 2) / scale**2
            own = np.linalg.pinv(by_rotation.T @ (by_rotation * weights[:, None]))
            cross = by_slope.T @ (by_rotation * weights[:, None])
            own_right = by_rotation.T @ (weights * errors)
            normal += by_slope.T @ (by_slope * weights[:, None]) - cross @ own @ cross.T
            right += by_slope.T @ (weights * errors) - cross @ own @ own_right
            parts.append((own, cross, own_right))
        step = np.linalg.pinv(normal) @ right
        step *= min(1.0, 0.2 / max(float(np.abs(step).max()), 1e-12))
        slope = slope - step
        rotations = [
            _rotation(-own @ (own_right - cross.T @ step)) @ rotation
            for (own, cross, own_right), rotation in zip(parts, rotations, strict=True)
        ]
        if iteration >= 2 * len(_SCALE_SHARES) and np.abs(step).max() < _SETTLED:
            break
    return slope, rotations


def _linearised(tracks: Tracks, rotation: Floats, slope: Floats) -> tuple[Floats, Floats, Floats]:
    """Distances from the line through the focus (n,), and their slopes by t (n, 2) and by the rotation (n, 3)."""
    place = _turned(tracks.before, rotation)
    flow = tracks.after - place
    arm = (place + tracks.after) / 2 - slope  # from the focus to the middle of the flow vector
    length = np.maximum(np.hypot(*arm.T), 0.02)[:, None]
    normal = np.stack([-arm[:, 1], arm[:, 0]], axis=1) / length
    errors = np.einsum("ni,ni->n", normal, flow)
    along = np.einsum("ni,ni->n", arm / length, flow)
    by_slope = normal * (along[:, None] / length)
    by_rotation = -np.einsum("ni,nij->nj", normal, motion_field(place))
    return by_slope, by_rotation, errors


def _rotation(vector_rad: Floats) -> Floats:
    return np.asarray(cv2.Rodrigues(vector_rad)[0], np.float64)


def _turned(place: Floats, rotation: Floats) -> Floats:
    rays = np.column_stack([place, np.ones(len(place))]) @ rotation.T
    turned: Floats = rays[:, :2] / rays[:, 2:]
    return turned


def _derotated(used: Sequence[Tracks], rotations: Sequence[Floats]) -> tuple[Floats, Floats]:
    place = [_turned(tracks.before, rotation) for tracks, rotation in zip(used, rotations, strict=True)]
    return np.concatenate(place), np.concatenate([t.after - p for t, p in zip(used, place, strict=True)])


def _result(focus: Focus, lens: Lens, image: npt.NDArray[np.uint8], config: Config) -> Result:
    x, y = lens.cx + lens.fx * focus.slope[0], lens.cy + lens.fy * focus.slope[1]
    sigma_deg = np.degrees(focus.sigma)
    turned = f"; {focus.left_out} left out, in which it turned" if focus.left_out else ""
    findings = (
        f"{focus.intervals} intervals of straight driving{turned}; {len(focus.place)} flow vectors",
        f"focus of expansion: x {x:.1f}, y {y:.1f} px of the undistorted image",
        f"yaw: {np.degrees(focus.yaw_rad):+.2f} ± {sigma_deg[0]:.2f}° (positive: looks to the right)",
        f"pitch: {np.degrees(focus.pitch_rad):+.2f} ± {sigma_deg[1]:.2f}° (positive: looks up)",
        f"configured: yaw {np.degrees(config.camera.yaw_rad):+.2f}°, pitch {np.degrees(config.camera.pitch_rad):+.2f}°",
    )
    values = {"yaw_rad": round(focus.yaw_rad, 4), "pitch_rad": round(focus.pitch_rad, 4)}
    return Result(findings, "camera", values, _painter(focus, lens, image))


def _painter(focus: Focus, lens: Lens, image: npt.NDArray[np.uint8]) -> "Callable[[Figure], None]":
    def paint(figure: "Figure") -> None:
        left, right = figure.subplots(1, 2, width_ratios=(3, 2))
        left.imshow(image, cmap="gray", vmin=0, vmax=400)
        rows = np.random.default_rng(0).permutation(len(focus.place))[:600]
        scale, centre = (lens.fx, lens.fy), (lens.cx, lens.cy)
        ends = [
            lens.distort((ray[rows] * scale + centre).astype(np.float32))
            for ray in (focus.place, focus.place + focus.flow)
        ]
        left.quiver(
            *ends[0].T, *(ends[1] - ends[0]).T, angles="xy", scale_units="xy", scale=1, width=0.0015, color="#ffd23f"
        )
        at = lens.distort((focus.slope[None] * scale + centre).astype(np.float32))[0]
        left.plot(*at, "+", color=report.RED, markersize=22, markeredgewidth=2)
        left.plot(*centre, "x", color="white", markersize=9)
        left.set(xlim=(0, lens.width), ylim=(lens.height, 0))
        left.set_title("flow without rotation; +: its focus, x: the image's centre", loc="left")
        degrees = np.degrees(np.arctan(focus.pieces)) * (-1, 1)
        right.plot(*degrees.T, "o", color=report.BLUE, label="fifths of the drive")
        right.errorbar(
            np.degrees(focus.yaw_rad), np.degrees(focus.pitch_rad), *np.degrees(focus.sigma[::-1]),
            fmt="+", color=report.RED, markersize=14, label="all, 1 sigma",
        )  # fmt: skip
        right.set(xlabel="yaw, °", ylabel="pitch, °")
        right.set_title("mounting", loc="left")
        right.margins(0.3)
        right.grid(alpha=0.25)
        right.legend(fontsize=8)

    return paint
