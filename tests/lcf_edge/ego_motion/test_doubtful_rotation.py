"""Rendered drives whose gyro has a bias, dies, sticks or is missing; and a sudden shock: the images show the rest."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from msgspec.structs import replace as with_values

from benchmarks.playing import config_of
from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config, Imu, Vehicle
from lcf_edge.ego_motion.estimator import EgoMotionEstimator
from lcf_edge.ego_motion.image_rotation import ImageRotation
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens
from lcf_edge.pipeline import Pipeline
from lcf_edge.rendered import scenes
from lcf_edge.rendered.trajectory import Trajectory
from lcf_edge.small_image import SmallImage

Spoil = Callable[[Sequence[ImuSample]], Sequence[ImuSample]]

DRIVE = scenes.make("turn", 2, seconds=3.0)
FRAMES = [frame for frame, _ in scenes.frames(DRIVE)]
LATE_NS = 20_000_000
HALF = len(FRAMES) // 2
BIAS = (0.08, -0.08, 0.05)


@dataclass
class Seen:
    """Of each frame: by how much the rotation was off that was given to the filter, and what the flow left, mrad."""

    given_mrad: np.ndarray
    left_mrad: np.ndarray
    notes: list[tuple[str, ...]]
    pipeline: Pipeline


@pytest.fixture(scope="module")
def truth() -> list[np.ndarray]:
    """Rotations, (3, 3) each."""
    ego = EgoMotionEstimator(Imu(), Vehicle())
    perfect = replace(DRIVE, noise=replace(DRIVE.noise, gyro_radps=0.0))
    return [motion for _, motion in fed(ego, FRAMES, scenes.imu(perfect))]


def fed(
    ego: EgoMotionEstimator, frames: Sequence[Frame], samples: Sequence[ImuSample]
) -> Iterator[tuple[Frame, np.ndarray]]:
    given = 0
    for frame in frames:
        while given < len(samples) and samples[given].stamp_ns <= frame.stamp_ns + LATE_NS:
            ego.add_imu(samples[given])
            given += 1
        yield frame, ego.advance(frame.stamp_ns).rotation


def driven(truth: list[np.ndarray], spoil: Spoil, bias: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Seen:
    """Without odometry's yaw rate."""
    config = config_of(DRIVE)
    pipeline = Pipeline(config, Lens.from_config(config.camera, 640, 480))
    motions: list[Motion] = []
    residuals: list[np.ndarray] = []
    step = pipeline.filter.step

    def watched(corners: object, motion: Motion, *images: object) -> object:
        taken = step(corners, motion, *images)  # type: ignore[arg-type]
        motions.append(motion)
        residuals.append(taken.residual.turn_rad if taken.residual else np.zeros(3))
        return taken

    pipeline.filter.step = watched  # type: ignore[method-assign, assignment]
    biased = replace(DRIVE, noise=replace(DRIVE.noise, gyro_bias_radps=bias))
    speeds = [replace(speed, yaw_rate_radps=float("nan")) for speed in scenes.odometry(DRIVE)]
    samples: list[ImuSample | SpeedSample] = sorted(
        [*spoil(scenes.imu(biased)), *speeds], key=lambda sample: sample.stamp_ns
    )
    notes, given = [], 0
    for frame in FRAMES:
        while given < len(samples) and samples[given].stamp_ns <= frame.stamp_ns + LATE_NS:
            pipeline.add(samples[given])
            given += 1
        notes.append(pipeline.process(frame).notes)
    given_mrad, left_mrad = [], []
    for motion, residual, rotation in zip(motions, residuals, truth, strict=True):
        given_mrad.append(1e3 * cv2.Rodrigues(motion.rotation @ rotation.T)[0].ravel())
        flown = cv2.Rodrigues(residual)[0] @ motion.rotation
        left_mrad.append(1e3 * cv2.Rodrigues(flown @ rotation.T)[0].ravel())
    return Seen(np.abs(given_mrad), np.abs(left_mrad), notes, pipeline)


def untouched(samples: Sequence[ImuSample]) -> Sequence[ImuSample]:
    return samples


def none(samples: Sequence[ImuSample]) -> Sequence[ImuSample]:
    del samples
    return ()


def dies(samples: Sequence[ImuSample]) -> Sequence[ImuSample]:
    return [sample for sample in samples if sample.stamp_ns < FRAMES[HALF].stamp_ns]


def sticks(samples: Sequence[ImuSample]) -> Sequence[ImuSample]:
    end_ns = FRAMES[HALF].stamp_ns
    last = next(sample for sample in samples if sample.stamp_ns >= end_ns)
    return [sample if sample.stamp_ns < end_ns else replace(sample, gyro=last.gyro) for sample in samples]


@pytest.mark.parametrize("bias", [BIAS, (-0.35, 0.35, -0.2)], ids=["0.08 rad/s", "20 degrees a second"])
def test_a_bias_is_learnt_while_the_vehicle_drives(truth: list[np.ndarray], bias: tuple[float, float, float]) -> None:
    seen = driven(truth, untouched, bias)
    learnt = seen.pipeline.gyro_bias
    assert (np.abs(learnt.mean_radps - bias) < 2 * learnt.sigma_radps).all()
    assert learnt.known
    assert not any(seen.notes[10:])
    assert np.median(seen.given_mrad[10:]) < 0.5  # a quarter of a pixel


def test_without_an_imu_the_images_show_the_turn(truth: list[np.ndarray]) -> None:
    seen = driven(truth, none)
    assert all("no imu" in notes for notes in seen.notes)
    assert np.percentile(seen.given_mrad[10:], 90) < 6.0
    assert np.percentile(seen.left_mrad[10:], 90) < 1.0


def hangs(samples: Sequence[ImuSample]) -> Sequence[ImuSample]:
    end_ns = FRAMES[HALF].stamp_ns
    last = next(sample for sample in samples if sample.stamp_ns >= end_ns)
    return [sample if sample.stamp_ns < end_ns else replace(last, stamp_ns=sample.stamp_ns) for sample in samples]


@pytest.mark.parametrize(("spoil", "note"), [(dies, "no imu"), (sticks, "gyro stuck"), (hangs, "gyro stuck")])
def test_a_gyro_that_ends_in_the_middle_is_reported_and_the_images_go_on(
    truth: list[np.ndarray], spoil: Spoil, note: str
) -> None:
    seen = driven(truth, spoil)
    assert not any(note in notes for notes in seen.notes[:HALF])
    assert all(note in notes for notes in seen.notes[HALF + 4 :])
    assert np.percentile(seen.left_mrad[HALF + 6 :], 90) < 1.5


@pytest.mark.parametrize("degrees", [-5, 3, 5])
def test_a_sudden_shock_is_survived_in_one_frame(degrees: int) -> None:
    """The camera, which has no gyro, is knocked aside from one image to the next."""
    drive = scenes.make("passing", 3, seconds=1.5, width=800)
    config = config_of(drive)
    focal = drive.lens.focal_px
    camera = with_values(config.camera, width=640, intrinsics=[focal, focal, 319.5, 239.5])
    pipeline = Pipeline(with_values(config, camera=camera), Lens.from_config(camera, 640, 480))
    before, shocked, after = knocked(pipeline, drive, round(focal * np.tan(np.radians(degrees))))
    assert before > 0.4
    assert shocked > 0.4 * before  # without a look at the whole image: 0.03
    assert after > 0.8 * before


def knocked(pipeline: Pipeline, drive: scenes.Drive, shift_px: int) -> tuple[float, float, float]:
    """Share of the trusted edges that are found again before, at and after the shock."""
    shares = []
    for frame, _ in scenes.frames(drive):
        left = 80 + shift_px * (frame.seq >= 20)
        pipeline.add(SpeedSample(frame.stamp_ns, float(drive.speed.at(np.array(frame.seq / drive.fps))), float("nan")))
        pipeline.process(replace(frame, image=np.ascontiguousarray(frame.image[:, left : left + 640])))
        edges, n = pipeline.filter.edges, pipeline.filter.edges.count
        trusted = edges.trust[:n] >= Config().filter.tr_s
        shares.append(float(np.count_nonzero(trusted & edges.matched[:n])) / max(np.count_nonzero(trusted), 1))
    return shares[19], shares[20], shares[22]


STANDS = scenes.Profile(((0.0, 0.0),))
PASSES_CLOSE = scenes.Box("walker", 0.45, 1.7, 0.3, ((0.0, -1.2, 0.9), (3.0, 1.2, 0.9)))


def test_a_vehicle_that_stands_without_a_gyro_takes_nobody_who_passes_close_for_a_turn() -> None:
    """Its odometry measures neither motion nor turn; somebody covers a third of the image, in front of few things."""
    drive = scenes.make("passing", 3, seconds=3.0)
    drive = replace(drive, speed=STANDS, yaw_rate=STANDS, boxes=(*drive.boxes[:3], PASSES_CLOSE))
    config = config_of(drive)
    pipeline = Pipeline(config, Lens.from_config(config.camera, 640, 480))
    turned_mrad, sigma_mrad = [], []
    step = pipeline.filter.step

    def watched(corners: object, motion: Motion, *images: object) -> object:
        turned_mrad.append(1e3 * np.abs(cv2.Rodrigues(motion.rotation)[0]).max())
        sigma_mrad.append(1e3 * motion.rotation_sigma_rad)
        return step(corners, motion, *images)  # type: ignore[arg-type]

    pipeline.filter.step = watched  # type: ignore[method-assign, assignment]
    for frame, _ in scenes.frames(drive):
        for late_ns in range(-50_000_000, LATE_NS, 10_000_000):
            pipeline.add(SpeedSample(frame.stamp_ns + late_ns, 0.0, 0.0))
        pipeline.process(frame)
    assert max(turned_mrad[10:]) < 3.0
    assert max(sigma_mrad[10:]) < 1.5  # 0.04 rad/s, the least of a guess while it drives, would be 2


def odometry_alone(drive: scenes.Drive, yaw_rate: bool) -> Sequence[SpeedSample]:
    samples = scenes.odometry(drive)
    return samples if yaw_rate else [replace(sample, yaw_rate_radps=float("nan")) for sample in samples]


def of_drive(drive: scenes.Drive, yaw_rate: bool) -> Iterator[tuple[int, Motion, Pipeline]]:
    """Number, motion as given to the filter, and pipeline of each frame, without an IMU."""
    config = config_of(drive)
    pipeline = Pipeline(config, Lens.from_config(config.camera, 640, 480))
    motions: list[Motion] = []
    step = pipeline.filter.step

    def watched(corners: object, motion: Motion, *images: object) -> object:
        motions.append(motion)
        return step(corners, motion, *images)  # type: ignore[arg-type]

    pipeline.filter.step = watched  # type: ignore[method-assign, assignment]
    samples, given = odometry_alone(drive, yaw_rate), 0
    for frame, _ in scenes.frames(drive):
        while given < len(samples) and samples[given].stamp_ns <= frame.stamp_ns + LATE_NS:
            pipeline.add(samples[given])
            given += 1
        pipeline.process(frame)
        yield frame.seq, motions[-1], pipeline


@pytest.mark.parametrize("yaw_rate", [True, False], ids=["yaw rate by odometry", "no yaw rate"])
def test_somebody_who_crosses_close_without_a_gyro_is_not_taken_for_a_turn(yaw_rate: bool) -> None:
    """The vehicle drives straight on; the walker fills so much of the image that the whole seems to turn by 8°."""
    turned_rad = [abs(motion.rotation[0, 2]) for _, motion, _ in of_drive(scenes.make("crossing", 90), yaw_rate)]
    assert max(turned_rad[10:]) < 0.02


def test_turns_of_100_degrees_a_second_are_followed_without_gyro_and_yaw_rate() -> None:
    """To and fro, at 20 images a second. O stays where the vehicle is heading, and so do both in the camera's axes."""
    rate = np.radians(100)
    knots = ((0.0, 0.0), (1.5, 0.0), (1.75, rate), (2.1, rate), (2.6, -rate), (2.95, -rate), (3.2, 0.0))
    drive = replace(scenes.make("passing", 92), yaw_rate=scenes.Profile(knots), seconds=4.0)
    off_rad, missed_rad = [], []
    times = np.arange(0.0, 4.0, 0.05)
    truth = -np.diff(Trajectory(drive).heading(times))  # right positive, as the image moves to the left
    for number, motion, pipeline in of_drive(drive, yaw_rate=False):
        if number >= 20:
            off_rad.append(abs(pipeline.filter.focus[0] - 319.5) / drive.lens.focal_px)
            missed_rad.append(abs(np.arcsin(motion.rotation[0, 2]) + truth[number - 1]))
    assert np.percentile(missed_rad, 90) < 0.02
    assert np.percentile(off_rad, 90) < 0.05  # with a path that follows within 0.4 s: 0.15


def test_an_image_without_corners_shows_no_rotation_however_far_it_shifts() -> None:
    noise = np.random.default_rng(5).normal(0, 1, (480, 1280))
    soft = cv2.GaussianBlur(noise, (0, 0), 14)
    soft = np.clip(128 + 40 * soft / soft.std(), 0, 255).astype(np.uint8)
    images = [np.ascontiguousarray(soft[:, left : left + 640]) for left in range(0, 600, 60)]
    lens = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
    alone, small = ImageRotation(lens), SmallImage(640, 480)
    turns = [alone.turn(small.of(image)) for image in images]
    assert all(turn is not None and turn.turn_rad[1] < -0.1 for turn in turns[1:])

    pipeline = Pipeline(Config(), lens)
    for number, image in enumerate(images):
        scene = pipeline.process(Frame(50_000_000 * number, number, image))
        assert scene.sizes.corners < 15
        assert "rotation from pictures" not in scene.notes
