"""The lens, from views of a board (Zhang 2000, with OpenCV's models)."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import cv2
import numpy as np
import numpy.typing as npt

from drivers.samples import Frame
from lcf_edge.calibrate import report
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.result import CalibrationError, Result
from lcf_edge.calibrate.sources import SensorSource
from lcf_edge.calibrate.target import Sighting, Target
from lcf_edge.calibrate.views import CELLS, Views
from lcf_edge.lens import Lens
from lcf_edge.printable import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.float32]
Model = Literal["radial-tangential", "equidistant"]

MIN_VIEWS = 8

_MAX_LEFT_OUT = 0.25  # of the views, as outliers
_OUTLIER = 3.0  # times the median error of a view
_OUTLIER_PX = 0.3
_MAX_ERROR_PX = 1.0
_MAX_FOCAL_SIGMA = 0.005  # of the focal length
_MAX_CENTRE_SIGMA = 0.005  # of the image's width
_MIN_COVERAGE = 0.5  # of the cells
_MIN_SPREAD = 0.2  # share of width and height over which the board's centres must spread
_MIN_TILT_RAD = np.radians(15)
_MIN_TILTED = 3  # views


@dataclass(frozen=True)
class Solution:
    """Intrinsics fx, fy, cx, cy (px), distortion, 1 sigma of all eight, and residuals (n, 2) px of each view."""

    intrinsics: Floats
    distortion: Floats
    sigma: Floats  # (8,)
    tilts_rad: Floats  # of the board against the image, each view
    residuals: tuple[Floats, ...]

    @property
    def errors_px(self) -> Floats:
        """Root mean square reprojection error of each view, px."""
        return np.array([np.sqrt((view**2).sum(axis=1).mean()) for view in self.residuals])

    @property
    def error_px(self) -> float:
        """Root mean square reprojection error of all corners, px."""
        return float(np.sqrt((np.concatenate(self.residuals) ** 2).sum(axis=1).mean()))


def calibrate_camera(source: SensorSource, board: Target, model: Model, views_wanted: int, guide: Guide) -> Result:
    """Return the lens from ``views_wanted`` views, or as many as a recording has. Raises ``CalibrationError``."""
    views = collect(source, board, views_wanted, guide)
    return solve(views, model)


def collect(source: SensorSource, board: Target, views_wanted: int, guide: Guide) -> Views:
    """Views of the board, with prompts where it should be held."""
    views = Views(board, source.film)
    if source.live:
        guide.say(f"Show the board ({board.name}) to the camera. A view is taken when it is held still.")
    for item in source.items():
        if not isinstance(item, Frame):
            continue
        reason = views.consider(item)
        if not reason and source.live:
            guide.say(f"view {len(views.kept)} of {views_wanted} taken")
        if len(views.kept) >= views_wanted and source.live:
            break
        guide.progress(f"{len(views.kept)} views; {f'{reason}; ' if reason else ''}{views.wish()}")
    guide.end()
    if not source.live and len(views.kept) > views_wanted:
        _thin_out(views, views_wanted)
    return views


def _thin_out(views: Views, views_wanted: int) -> None:
    """Keep ``views_wanted`` views, spread over the recording."""
    rows = np.linspace(0, len(views.kept) - 1, views_wanted).round().astype(int)
    views.left_out["more than asked for"] += len(views.kept) - views_wanted
    views.kept = [views.kept[row] for row in rows]


def solve(views: Views, model: Model) -> Result:
    """Return a lens that can be trusted. Raises ``CalibrationError``."""
    refuse_poor(views)
    kept, dropped = list(views.kept), 0
    solution = fit(kept, views.board, views.size, model)
    limit = max(_OUTLIER * float(np.median(solution.errors_px)), _OUTLIER_PX)
    good = solution.errors_px <= limit
    if not good.all() and np.count_nonzero(~good) <= _MAX_LEFT_OUT * len(kept) and good.sum() >= MIN_VIEWS:
        dropped = int(np.count_nonzero(~good))
        kept = [view for view, is_good in zip(kept, good, strict=True) if is_good]
        solution = fit(kept, views.board, views.size, model)
    refuse_unbelievable(solution, views, model)
    return _result(solution, kept, dropped, views, model)


def refuse_poor(views: Views) -> None:
    """Refuse views that do not determine a lens. Raises ``CalibrationError``."""
    if len(views.kept) < MIN_VIEWS:
        reasons = ", ".join(f"{count} {reason}" for reason, count in views.left_out.most_common(3)) or "no images"
        raise CalibrationError(
            f"camera: {len(views.kept)} usable views of {views.board.name}, at least {MIN_VIEWS} are needed "
            f"(left out: {reasons}); check --board, light and focus, and show it from more sides"
        )
    middles = np.array([view.corners.mean(axis=0) for view in views.kept]) / views.size
    spread = np.ptp(middles, axis=0)
    if spread.min() < _MIN_SPREAD:
        way = ("from left to right", "up and down")[int(np.argmin(spread))]
        raise CalibrationError(f"camera: the board was always in one place; move it {way} through the whole image")
    share = float(views.covered().mean())
    if share < _MIN_COVERAGE:
        raise CalibrationError(
            f"camera: corners were seen in {share:.0%} of the image, {_MIN_COVERAGE:.0%} are needed; hold the "
            "board nearer, and into the image's corners"
        )


def refuse_unbelievable(solution: Solution, views: Views, model: Model) -> None:
    """Refuse a lens that the views do not support. Raises ``CalibrationError``."""
    if not solution.error_px < _MAX_ERROR_PX:
        raise CalibrationError(
            f"camera: corners are {solution.error_px:.2f} px from where a {model} lens would put them; check that the "
            "board is flat and --board right, or try the other --model"
        )
    tilted = int(np.count_nonzero(solution.tilts_rad > _MIN_TILT_RAD))
    if tilted < _MIN_TILTED:
        raise CalibrationError(
            f"camera: the board was tilted in {tilted} views, {_MIN_TILTED} are needed to determine the focal length; "
            "tilt it by 30 to 45° to each side"
        )
    focal, centre = solution.sigma[:2] / solution.intrinsics[:2], solution.sigma[2:4] / views.size[0]
    if focal.max() > _MAX_FOCAL_SIGMA or centre.max() > _MAX_CENTRE_SIGMA:
        raise CalibrationError(
            f"camera: the focal length is only known to {focal.max():.1%}, the centre to "
            f"{solution.sigma[2:4].max():.1f} px; take more views, nearer and more tilted"
        )
    width, height = views.size
    fx, fy, cx, cy = solution.intrinsics.tolist()
    lens = Lens(width, height, fx, fy, cx, cy, model, tuple(solution.distortion.tolist()))
    corners = np.array([(x, y) for x in (0, width - 1) for y in (0, height - 1)], np.float32)
    if not np.isfinite(lens.undistort(corners)).all():
        raise CalibrationError(
            "camera: the lens that was found folds back inside the image; take views in the image's corners, or "
            "try the other --model"
        )


def fit(kept: list[Sighting], board: Target, size: tuple[int, int], model: Model) -> Solution:
    """Fit the lens to all corners by least squares. Raises ``CalibrationError``."""
    places = [board.places[view.numbers] for view in kept]
    corners = [view.corners for view in kept]
    try:
        return (_fit_radial if model == "radial-tangential" else _fit_equidistant)(places, corners, size)
    except cv2.error as error:
        raise CalibrationError(f"camera: no {model} lens fits these views ({error.err}); take other views") from error


def _fit_radial(places: list[Pixels], corners: list[Pixels], size: tuple[int, int]) -> Solution:
    _, matrix, distortion, rotations, translations, sigma, _, _ = cv2.calibrateCameraExtended(
        places, corners, size, np.eye(3), np.zeros(5), flags=cv2.CALIB_FIX_K3
    )
    four = np.ravel(distortion)[:4].astype(np.float64)
    shown = [
        cv2.projectPoints(place, turn, shift, matrix, four)[0].reshape(-1, 2)
        for place, turn, shift in zip(places, rotations, translations, strict=True)
    ]
    return _solution(matrix, four, np.ravel(sigma)[:8], rotations, corners, shown)


def _fit_equidistant(places: list[Pixels], corners: list[Pixels], size: tuple[int, int]) -> Solution:
    flat = [place.astype(np.float64)[None] for place in places]
    seen = [corner.astype(np.float64)[None] for corner in corners]
    flags = _fisheye_flag("CALIB_RECOMPUTE_EXTRINSIC") | _fisheye_flag("CALIB_FIX_SKEW")
    _, matrix, distortion, rotations, translations = cv2.fisheye.calibrate(
        flat, seen, size, np.eye(3), np.zeros(4), flags=flags
    )
    four = np.ravel(distortion).astype(np.float64)
    shown, normal, free = [], np.zeros((8, 8)), -8
    for place, turn, shift in zip(flat, rotations, translations, strict=True):
        points, slopes = cv2.fisheye.projectPoints(place, turn, shift, matrix, four)
        shown.append(points.reshape(-1, 2))
        lens, pose = np.asarray(slopes)[:, :8], np.asarray(slopes)[:, 8:14]
        across = lens.T @ pose
        normal += lens.T @ lens - across @ np.linalg.solve(pose.T @ pose, across.T)  # eliminates the pose
        free += len(slopes) - 6
    errors = np.concatenate([(a - b).ravel() for a, b in zip(corners, shown, strict=True)])
    sigma = np.sqrt(np.diag(np.linalg.inv(normal)) * (errors @ errors) / max(free, 1))
    return _solution(matrix, four, sigma, rotations, corners, shown)


def _fisheye_flag(name: str) -> int:
    """OpenCV 4 has these in ``cv2.fisheye``, 5 beside the others with other values."""
    return int(getattr(cv2.fisheye, name, None) or getattr(cv2, name))


def _solution(
    matrix: npt.ArrayLike,
    distortion: Floats,
    sigma: npt.ArrayLike,
    rotations: Iterable[npt.ArrayLike],
    corners: Iterable[npt.ArrayLike],
    shown: Iterable[npt.ArrayLike],
) -> Solution:
    k = np.asarray(matrix, np.float64)
    normals = [cv2.Rodrigues(np.asarray(turn, np.float64))[0][2, 2] for turn in rotations]
    return Solution(
        np.array([k[0, 0], k[1, 1], k[0, 2], k[1, 2]]),
        distortion,
        np.asarray(sigma, np.float64),
        np.arccos(np.clip(np.abs(normals), 0, 1)).astype(np.float64),
        tuple(np.asarray(a, np.float64) - np.asarray(b, np.float64) for a, b in zip(corners, shown, strict=True)),
    )


def _result(solution: Solution, kept: list[Sighting], dropped: int, views: Views, model: Model) -> Result:
    fx, fy, cx, cy = solution.intrinsics
    errors, sigma, tilt_deg = solution.errors_px, solution.sigma, np.degrees(solution.tilts_rad.max())
    left_out = ", ".join(f"{count} {reason}" for reason, count in views.left_out.most_common())
    findings = (
        f"{len(kept)} views of {views.board.name}, {sum(len(view.corners) for view in kept)} corners"
        + (f"; {counted(dropped, 'view')} left out, with outlying errors" if dropped else ""),
        f"images left out: {left_out or 'none'}",
        f"reprojection error: {solution.error_px:.3f} px; of a view {errors.min():.3f} to {errors.max():.3f} px",
        f"image covered: {views.covered().mean():.0%}; board tilted by up to {tilt_deg:.0f}°",
        f"focal length: {fx:.2f} ± {sigma[0]:.2f}, {fy:.2f} ± {sigma[1]:.2f} px",
        f"centre: {cx:.2f} ± {sigma[2]:.2f}, {cy:.2f} ± {sigma[3]:.2f} px",
        "distortion: " + ", ".join(f"{k:.4f} ± {s:.4f}" for k, s in zip(solution.distortion, sigma[4:], strict=True)),
    )
    values: dict[str, str | int | list[float]] = {
        "width": views.size[0],
        "height": views.size[1],
        "intrinsics": solution.intrinsics.round(3).tolist(),
        "distortion_model": model,
        "distortion": solution.distortion.round(6).tolist(),
    }
    return Result(findings, "camera", values, _painter(solution, kept, views))


def _painter(solution: Solution, kept: list[Sighting], views: Views) -> "Callable[[Figure], None]":
    def paint(figure: "Figure") -> None:
        width, height = views.size
        left, right = figure.subplots(1, 2, width_ratios=(3, 2))
        corners = np.concatenate([view.corners for view in kept])
        errors = np.concatenate(solution.residuals)
        left.pcolormesh(
            np.linspace(0, width, CELLS[0] + 1), np.linspace(0, height, CELLS[1] + 1), views.covered(),
            cmap="Greens", vmin=0, vmax=4, edgecolors="white",
        )  # fmt: skip
        stretch = 0.03 * width / max(float(np.percentile(np.abs(errors), 99)), 1e-9)
        stretch = float(f"{stretch:.0e}")
        left.quiver(
            *corners.T, *errors.T, angles="xy", scale_units="xy", scale=1 / stretch, width=0.0015, color=report.BLUE
        )
        left.plot(solution.intrinsics[2], solution.intrinsics[3], "+", color=report.RED, markersize=14)
        left.set(xlim=(0, width), ylim=(height, 0), aspect="equal", xlabel="px", ylabel="px")
        left.set_title(f"corners, their errors {stretch:g} times; green: covered; +: centre", loc="left")
        right.bar(np.arange(1, len(kept) + 1), solution.errors_px, color=report.BLUE)
        right.axhline(solution.error_px, color=report.RED, linewidth=1)
        right.set(xlabel="view", ylabel="px")
        right.locator_params(axis="x", integer=True)
        right.set_title(f"reprojection error, in all {solution.error_px:.3f} px", loc="left")
        for axes in (left, right):
            axes.spines[["top", "right"]].set_visible(False)

    return paint
