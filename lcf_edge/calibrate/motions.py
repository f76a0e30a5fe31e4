"""The IMU's axes from motions by hand: gravity shows which way is up, and each motion is about a known vehicle axis.

The user is guided through the steps; each ends when the vehicle is at rest again. Hand motions are accurate to some
10°, enough to recognise an IMU that is mounted square. Vehicle axes: x right, y down, z ahead.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from drivers.samples import ImuSample
from lcf_edge.calibrate import report
from lcf_edge.calibrate.axes import axes_result, snapped
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.rest import Rest, measure
from lcf_edge.calibrate.result import CalibrationError, Result
from lcf_edge.calibrate.rotations import best_rotation
from lcf_edge.calibrate.sources import SensorSource
from lcf_edge.config import Camera, Config

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]

_WINDOW_S = 0.6  # of rest, at the end of a step
_REST_S = 4.0  # the same before the first step
_EVERY_S = 0.1
_STILL_GYRO_RADPS = 0.06
_STILL_GYRO_STD_RADPS = 0.05
_STILL_ACCEL_STD_MPS2 = 0.4
_LEVEL_RAD = np.radians(10)
_MAX_SATURATED_S = 0.02
_MAX_MISFIT_RAD = np.radians(25)
_UP_WEIGHT = 4.0  # weight of gravity, which is known better than a hand's axis


@dataclass(frozen=True)
class Step:
    """A motion: instruction, least angle, axis of the vehicle (None: back to level), whether it tilts."""

    prompt: str
    name: str
    min_rad: float = 0.0
    axis: tuple[float, float, float] | None = None
    tips: bool = False


STEPS = (
    Step(
        "Tip its nose down by about 45°, straight, and hold it there.",
        "nose down",
        np.radians(20),
        (-1.0, 0.0, 0.0),
        tips=True,
    ),
    Step("Put it back on level ground.", "back to level"),
    Step(
        "Tip it onto its right side by about 45°, and hold it there.",
        "right side down",
        np.radians(20),
        (0.0, 0.0, 1.0),
        tips=True,
    ),
    Step("Put it back on level ground.", "back to level"),
    Step("Turn it left on the spot by about 90°, and let it stand.", "left turn", np.radians(45), (0.0, -1.0, 0.0)),
)


@dataclass
class Motions:
    """Follows the samples through the steps. ``turns``: rotation vector (3,), rad, IMU axes, of steps with an axis."""

    rest: Rest | None = None
    turns: dict[str, Floats] = field(default_factory=dict)
    samples: list[ImuSample] = field(default_factory=list)
    _step: int = 0
    _rotation: Floats = field(default_factory=lambda: np.eye(3))  # since the step began
    _still_from: int = 0  # row of the first sample after the last time that it moved
    _looked_ns: int = 0
    _saturated_s: float = 0.0

    @property
    def done(self) -> bool:
        """Whether all steps were made."""
        return self.rest is not None and self._step == len(STEPS)

    @property
    def prompt(self) -> str:
        """What to do now."""
        return (
            STEPS[self._step].prompt if self.rest else "Let the vehicle stand on level ground: hands off, motors off."
        )

    @property
    def name(self) -> str:
        """Name of the present step."""
        return STEPS[self._step].name if self.rest else "rest on level ground"

    def add(self, sample: ImuSample) -> bool:
        """Take a sample. Return whether it ended a step. Raises ``CalibrationError``."""
        if self.samples and self.rest:
            self._turn(self.samples[-1], sample, self.rest)
        self.samples.append(sample)
        if sample.stamp_ns - self._looked_ns < _EVERY_S * 1e9:
            return False
        self._looked_ns = sample.stamp_ns
        window = self._window(_WINDOW_S)
        if not _still(window, self.rest):
            self._still_from = len(self.samples)
            return False
        if self.rest is None:
            return self._begin()
        return self._end(self.rest, window)

    @property
    def turned_rad(self) -> float:
        """Angle turned in the present step so far, rad."""
        return float(np.linalg.norm(cv2.Rodrigues(self._rotation)[0]))

    def _begin(self) -> bool:
        still = self.samples[self._still_from :]
        if not still or (still[-1].stamp_ns - still[0].stamp_ns) < _REST_S * 1e9:
            return False
        self.rest = measure(still)
        return True

    def _turn(self, before: ImuSample, now: ImuSample, rest: Rest) -> None:
        dt_s = (now.stamp_ns - before.stamp_ns) * 1e-9
        if now.saturated:
            self._saturated_s += dt_s
            if self._saturated_s > _MAX_SATURATED_S:
                raise CalibrationError(
                    f"imu: the gyro was at the end of its range ({self.name}); move more slowly, or raise "
                    "imu.gyro_range_dps"
                )
        rate = (np.array(before.gyro) + now.gyro) / 2 - rest.bias_radps
        self._rotation = self._rotation @ cv2.Rodrigues(rate * dt_s)[0]

    def _end(self, rest: Rest, window: Sequence[ImuSample]) -> bool:
        step = STEPS[self._step]
        up = np.mean([sample.accel for sample in window], axis=0)
        tilt_rad = _between(up, rest.force_mps2)
        if (tilt_rad < step.min_rad) if step.tips else (tilt_rad > _LEVEL_RAD):
            return False
        if step.axis is not None:
            if self.turned_rad < step.min_rad:
                return False
            self.turns[step.name] = cv2.Rodrigues(self._rotation)[0].ravel().astype(np.float64)
        self._step += 1
        self._rotation = np.eye(3)
        return True

    def _window(self, seconds: float) -> list[ImuSample]:
        start_ns = self.samples[-1].stamp_ns - seconds * 1e9
        first = len(self.samples)
        while first and self.samples[first - 1].stamp_ns >= start_ns:
            first -= 1
        return self.samples[first:]


def calibrate_motions(source: SensorSource, config: Config, snap_rad: float, guide: Guide) -> Result:
    """``imu.axes`` and ``imu.gyro_noise_radps``. Raises ``CalibrationError``."""
    motions = Motions()
    if source.live:
        guide.say(motions.prompt)
    for item in source.items():
        if not isinstance(item, ImuSample):
            continue
        if motions.add(item):
            if motions.done:
                break
            if source.live:
                guide.say(motions.prompt)
        guide.progress(f"{motions.name}: turned {np.degrees(motions.turned_rad):.0f}°")
    guide.end()
    if motions.rest is None or not motions.done:
        raise CalibrationError(
            f"imu: the samples end before this was seen: {motions.name}; expected, in this order: rest on level ground "
            f"for {_REST_S:g} s, {', '.join(step.name for step in STEPS)}"
        )
    vehicle, misfits = axes_of(motions.rest, motions.turns)
    vehicle, words = snapped(vehicle, snap_rad)
    findings = (
        *motions.rest.findings(),
        "the motions were off these axes by "
        + ", ".join(f"{np.degrees(misfit):.0f}° ({name})" for name, misfit in misfits.items()),
        *words,
    )
    if config.camera.yaw_rad or config.camera.pitch_rad:
        findings += ("camera.yaw_rad and camera.pitch_rad are allowed for: the motions were the vehicle's",)
    return axes_result(
        camera_from_vehicle(config.camera) @ vehicle,
        findings,
        {"gyro_noise_radps": motions.rest.gyro_noise_radps},
        config,
        _painter(motions),
    )


def axes_of(rest: Rest, turns: dict[str, Floats]) -> tuple[Floats, dict[str, float]]:
    """IMU's axes to the vehicle's, and by how much each motion is off, rad. Raises ``CalibrationError``."""
    pairs = [(np.array([0.0, -1.0, 0.0]), rest.force_mps2 / rest.gravity_mps2, _UP_WEIGHT)]
    pairs += [
        (np.array(step.axis), turns[step.name] / np.linalg.norm(turns[step.name]), 1.0) for step in STEPS if step.axis
    ]
    axes, _ = best_rotation(np.sum([weight * np.outer(there, here) for there, here, weight in pairs], axis=0))
    names = ["up", *turns]
    misfits = {name: _between(axes @ here, there) for name, (there, here, _) in zip(names, pairs, strict=True)}
    worst = max(misfits, key=lambda name: misfits[name])
    if misfits[worst] > _MAX_MISFIT_RAD:
        raise CalibrationError(
            f"imu: the motions contradict each other ({worst} is {np.degrees(misfits[worst]):.0f}° off); one went the "
            "wrong way or at a slant, or the gyro's axes are not the accelerometer's: try again, one axis at a time"
        )
    return axes, misfits


def camera_from_vehicle(camera: Camera) -> Floats:
    """Return the rotation (3, 3) from the vehicle's axes to the camera's, by the configured mounting."""
    pitch = cv2.Rodrigues(np.array([-camera.pitch_rad, 0.0, 0.0]))[0]
    yaw = cv2.Rodrigues(np.array([0.0, -camera.yaw_rad, 0.0]))[0]
    rotation: Floats = np.asarray(pitch @ yaw, np.float64)
    return rotation


def _still(window: Sequence[ImuSample], rest: Rest | None) -> bool:
    if len(window) < 5 or window[-1].stamp_ns - window[0].stamp_ns < 0.8 * _WINDOW_S * 1e9:
        return False
    gyro = np.array([sample.gyro for sample in window])
    accel = np.array([sample.accel for sample in window])
    bias = rest.bias_radps if rest else gyro.mean(axis=0)
    return bool(
        np.abs(gyro.mean(axis=0) - bias).max() < _STILL_GYRO_RADPS
        and gyro.std(axis=0).max() < _STILL_GYRO_STD_RADPS
        and accel.std(axis=0).max() < _STILL_ACCEL_STD_MPS2
    )


def _between(one: Floats, other: Floats) -> float:
    """Return the angle between two vectors, rad."""
    cosine = one @ other / (np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.arccos(np.clip(cosine, -1, 1)))


def _painter(motions: Motions) -> "Callable[[Figure], None]":
    def paint(figure: "Figure") -> None:
        times_s = np.array([sample.stamp_ns - motions.samples[0].stamp_ns for sample in motions.samples]) * 1e-9
        gyro = np.array([sample.gyro for sample in motions.samples])
        accel = np.array([sample.accel for sample in motions.samples])
        both = zip(
            figure.subplots(2, 1, sharex=True), (gyro, accel), ("gyro, rad/s", "accelerometer, m/s²"), strict=True
        )
        for axes, values, title in both:
            for column, colour, name in zip(values.T, report.AXIS_COLOURS, "xyz", strict=True):
                axes.plot(times_s, column, color=colour, linewidth=1, label=f"IMU's {name}")
            report.plain(axes, title)
            axes.legend(loc="upper right", fontsize=8)
        axes.set_xlabel("s")

    return paint
