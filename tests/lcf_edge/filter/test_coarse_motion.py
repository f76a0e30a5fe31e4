"""What crosses fast, and has no corner that is found again, is found in the downscaled image."""

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from benchmarks.playing import config_of, play_drive
from drivers.samples import Frame
from lcf_edge.config import Camera, Config, Vehicle, load
from lcf_edge.evaluate.corpus import find
from lcf_edge.filter import LineCircleFilter, Motion
from lcf_edge.filter.inputs import NO_CORNERS
from lcf_edge.lens import Lens
from lcf_edge.messages import Cause, Kind
from lcf_edge.pipeline import Pipeline
from lcf_edge.recording.read import open_recording
from lcf_edge.rendered.drives import Box, Drive, Paint, Profile, SensorNoise
from lcf_edge.rendered.drives import Lens as RenderedLens
from lcf_edge.rendered.placing import through
from lcf_edge.rendered.trajectory import Trajectory
from lcf_edge.small_image import SmallImage

Grey = npt.NDArray[np.uint8]

LENS = Lens(640, 480, 1500.0, 1500.0, 319.5, 239.5)  # so narrow that a turn shifts all of the image alike
SMALL = SmallImage(LENS.width, LENS.height)
CONFIG = Config(camera=Camera(height_m=0.5), vehicle=Vehicle(half_width_m=0.4, height_m=1.2))
DT_S = 0.1
OFFICE = Path(os.environ.get("LCF_EDGE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "donkey-office"


def far_background(seed: int = 0) -> Grey:
    """Soft blobs, three images wide."""
    noise = np.random.default_rng(seed).normal(size=(LENS.height, 3 * LENS.width)).astype(np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), 12)
    return np.asarray(np.clip(150 + 25 * soft / soft.std(), 0, 255), np.uint8)


BACKGROUND = far_background()


@dataclass(frozen=True)
class Passing:
    """A plain dark thing before a far background; iterating gives the motion and the image of each step.

    ``left``, ``top``, ``width``, ``height``: px, in the first image. ``pxps``: its motion. ``turn_rad``: by which the
    camera turns in each frame. ``grows``: by which it stands nearer in each. ``until_seq``: then it is gone.
    ``contrast``: of the background. ``blobs``: of the thing itself, grey levels. ``on_lens``: it turns with the camera.
    """

    left: float = 120.0
    top: float = 200.0
    width: float = 150.0
    height: float = 90.0
    pxps: tuple[float, float] = (320.0, 0.0)
    turn_rad: float = 0.0
    grows: float = 1.0
    until_seq: int = 100
    speed_mps: float = 0.0
    frames: int = 8
    contrast: float = 1.0
    blobs: float = 0.0
    on_lens: bool = False
    dt_s: float = DT_S

    def __iter__(self) -> Iterator[tuple[Motion, Grey]]:
        random = np.random.default_rng(1)
        for seq in range(self.frames):
            shift_px = LENS.fx * math.tan(seq * self.turn_rad)
            start = LENS.width - round(shift_px)
            image = 150 + self.contrast * (BACKGROUND[:, start : start + LENS.width] - 150.0)
            if seq < self.until_seq:
                self.draw(image, seq, 0 if self.on_lens else round(shift_px))
            noisy = image + random.normal(0, 2, image.shape)
            cosine, sine = math.cos(self.turn_rad), math.sin(self.turn_rad)
            rotation = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
            yield Motion(self.dt_s, rotation, 0.0, self.speed_mps, 0.0), np.asarray(np.clip(noisy, 0, 255), np.uint8)

    def draw(self, image: npt.NDArray[np.float64], seq: int, shift_px: int) -> None:
        scale, time_s = self.grows**seq, seq * self.dt_s
        x = (self.left - LENS.cx) * scale + LENS.cx + self.pxps[0] * time_s + shift_px
        y = (self.top - LENS.cy) * scale + LENS.cy + self.pxps[1] * time_s
        left, top = round(x), round(y)
        right, foot = round(x + self.width * scale), round(y + self.height * scale)
        if not self.blobs:
            cv2.rectangle(image, (left, top), (right, foot), 30, -1)
            return
        seen = slice(max(left, 0), max(right, 0))
        paint = BACKGROUND[:, LENS.width :][:, seen.start - left : seen.stop - left]
        image[max(top, 0) : foot, seen] = 60 + self.blobs * (paint[: foot - max(top, 0)] - 150.0) / 25


@dataclass(frozen=True)
class Edge(Passing):
    """All that lies to the left of a straight edge through the image, tilted from the vertical, is dark."""

    tilt_deg: float = 0.0

    def draw(self, image: npt.NDArray[np.float64], seq: int, shift_px: int) -> None:
        x = self.left + self.pxps[0] * seq * self.dt_s + shift_px
        aside = math.tan(math.radians(self.tilt_deg)) * 400
        corners = [(-3000, -160), (x + aside, -160), (x - aside, 640), (-3000, 640)]
        cv2.fillPoly(image, [np.rint(corners).astype(np.int32)], 30)


def driven(scene: Passing, config: Config = CONFIG) -> Iterator[tuple[int, LineCircleFilter]]:
    """The filter after each frame, without a single corner."""
    tables = LineCircleFilter(config, LENS)
    for seq, (motion, image) in enumerate(scene):
        tables.step(NO_CORNERS, motion, image, SMALL.of(image))
        yield seq, tables


def rebels(scene: Passing) -> list[int]:
    """How many circles are reported in each frame."""
    return [int((tables.rebel.active & (tables.rebel.trust >= 3)).sum()) for _, tables in driven(scene)]


@pytest.mark.parametrize(("pxps", "moves"), [(0.0, False), (160.0, True)], ids=["stays", "moves"])
@pytest.mark.parametrize("turn_rad", [0.03, -0.03], ids=["turning left", "turning right"])
def test_a_drop_that_stays_in_the_image_as_the_camera_turns_does_not_move(
    turn_rad: float, pxps: float, moves: bool
) -> None:
    way_pxps = pxps if turn_rad < 0 else -pxps
    drop = Passing(280.0, width=80.0, height=80.0, pxps=(way_pxps, 0.0), turn_rad=turn_rad, on_lens=True)
    assert any(rebels(drop)) == moves


@pytest.mark.parametrize("turn_rad", [0.0, 0.015, -0.015], ids=["straight", "turning left", "turning right"])
def test_what_crosses_without_a_corner_is_found_with_its_motion(turn_rad: float) -> None:
    found = []
    for seq, tables in driven(Passing(turn_rad=turn_rad)):
        rebel = tables.rebel
        for c in np.flatnonzero(rebel.active & (rebel.trust >= 3)):
            found.append(seq)
            assert rebel.cause[c] == Cause.CROSSING
            assert rebel.speed[c] * math.cos(rebel.beta[c]) == pytest.approx(320, rel=0.15)
            assert abs(rebel.speed[c] * math.sin(rebel.beta[c])) < 80
            assert not math.isfinite(rebel.ttc[c])
    assert found
    assert min(found) <= 5
    assert max(found) == 7


def test_at_a_speed_that_is_not_known_what_moves_past_o_crosses_all_the_same() -> None:
    assert rebels(Passing(speed_mps=math.nan))[-1] == 1


@pytest.mark.parametrize("hidden", [False, True])
def test_where_no_world_is_seen_nothing_moves(hidden: bool) -> None:
    tables = LineCircleFilter(CONFIG, LENS)
    for motion, image in Passing():
        small = SMALL.of(image)
        tables.step(NO_CORNERS, motion, image, small, np.full_like(small, hidden))
    assert bool(tables.rebel.active.any()) != hidden


def test_it_becomes_an_object() -> None:
    objects = [bool((tables.objects.active & (tables.objects.trust >= 3)).any()) for _, tables in driven(Passing())]
    assert objects[-1]


@pytest.mark.parametrize(("left", "width", "first"), [(-300.0, 400.0, 6), (0.0, 300.0, 6), (0.0, 60.0, 4)])
def test_what_passes_near_from_top_to_bottom_of_the_image_is_found(left: float, width: float, first: int) -> None:
    near = Passing(left=left, top=0.0, width=width, height=480.0, pxps=(500.0, 0.0), dt_s=0.05, blobs=20.0)
    found = rebels(near)
    assert found[first]
    assert found[-1]


def test_slow_motion_is_seen_since_an_older_image() -> None:
    slow = Passing(pxps=(100.0, 0.0), dt_s=0.05, frames=20)  # 5 px a frame, less than one of the small ones
    assert rebels(slow)[-1] == 1


def test_what_is_seen_to_move_for_two_images_only_is_nothing() -> None:
    assert not any(tables.rebel.active.any() for _, tables in driven(Passing(until_seq=3)))


def test_what_stands_still_in_the_world_is_nothing_however_the_camera_turns() -> None:
    assert not any(rebels(Passing(pxps=(0.0, 0.0), turn_rad=0.015)))


@pytest.mark.parametrize("speed_mps", [3.0, math.nan], ids=["", "at a speed that is not known"])
@pytest.mark.parametrize(("left", "grows"), [(340.0, 1.1), (430.0, 1.1), (500.0, 1.05)])
def test_what_stands_beside_the_way_and_grows_as_it_is_passed_is_nothing(
    left: float, grows: float, speed_mps: float
) -> None:
    # from 3 or 6 m, 0.3 m nearer in each frame
    near = Passing(left=left, top=230.0, width=40.0, height=60.0, pxps=(0.0, 0.0), grows=grows, speed_mps=speed_mps)
    assert not any(rebels(near))


def test_what_hangs_in_the_air_moves_for_another_reason_than_that_it_drives() -> None:
    assert not any(rebels(Passing(top=40.0, height=100.0)))
    assert any(rebels(Passing(top=160.0, height=100.0)))  # as large, but it reaches below the horizon


@pytest.mark.parametrize("tilt_deg", [-71.6, -56.3, -45.0, -33.7, -18.4, 0.0, 18.4, 33.7, 45.0, 56.3, 71.6])
def test_a_straight_edge_does_not_show_how_it_moves(tilt_deg: float) -> None:
    assert not any(rebels(Edge(left=200.0, tilt_deg=tilt_deg, contrast=0.0)))


def test_where_the_rotation_is_uncertain_nothing_is_reported() -> None:
    tables = LineCircleFilter(CONFIG, LENS)
    for motion, image in Passing():
        unsure = replace(motion, rotation_sigma_rad=0.02)
        tables.step(NO_CORNERS, unsure, image, SMALL.of(image))
        assert not tables.rebel.active.any()


@pytest.mark.skipif(not OFFICE.is_dir(), reason=f"no {OFFICE}: set LCF_EDGE_DATA")
def test_where_a_lens_darkens_the_corners_of_the_image_nothing_moves() -> None:
    """A rover indoors, nobody in sight; brightness falls to four ninths left and right."""
    (recording,) = find([OFFICE])
    config = load(None, recording.settings)

    pipeline, found = Pipeline(config, Lens.from_config(config.camera, config.camera.width, config.camera.height)), 0
    v, u = np.indices((config.camera.height, config.camera.width))
    aside = np.hypot(u - config.camera.width / 2, v - config.camera.height / 2) / (config.camera.width / 2)
    light = (1 + aside**2 / 2) ** -2.0
    for item in open_recording(OFFICE, config):
        if not isinstance(item, Frame):
            pipeline.add(item)
            continue
        circles = pipeline.process(replace(item, image=np.asarray(light * item.image, np.uint8))).circles
        found += np.count_nonzero((circles["kind"] == Kind.REBEL) & (circles["trust"] >= 3))
    assert found < 10


def test_an_image_too_small_for_a_piece_is_no_fault() -> None:
    lens = Lens(16, 12, 12.0, 12.0, 7.5, 5.5)
    tables = LineCircleFilter(CONFIG, lens)
    small = SmallImage(16, 12)
    image = np.zeros((12, 16), np.uint8)
    for _ in range(3):
        tables.step(NO_CORNERS, Motion(DT_S, np.eye(3), 0.0, 1.0, 0.0), image, small.of(image))


@pytest.mark.parametrize("size", [(640, 480), (160, 120), (1242, 375), (1920, 1080), (3, 2), (1, 1)])
def test_in_small_every_image_has_about_as_many_pixels(size: tuple[int, int]) -> None:
    width, height = size
    small = SmallImage(width, height)
    image = np.full((height, width), 77, np.uint8)
    made = small.of(image)
    assert made.shape == (small.height, small.width) == (height // small.side, width // small.side)
    assert made.flags.c_contiguous
    assert (made == 77).all()
    assert 2400 <= made.size <= 9600 or small.side == 1


def dark_car(turn_radps: float) -> Drive:
    """A nearly black car crosses 11 m ahead at 9 m/s, before a bright sky; ten frames a second."""
    still = Profile(((0.0, 0.0),))
    lens = RenderedLens(1242, 375, 720.0)
    drive = Drive("dark_car", 0, 6.0, 10.0, Profile(((0.0, 4.0), (6.0, 5.0))), still, (), lens, SensorNoise())
    drive = replace(
        drive,
        yaw_rate=Profile(((0.0, turn_radps),)),
        camera_height_m=1.65,
        half_width_m=0.9,
        ground=Paint(1, feature_m=0.25, grey=105.0),
        sky=Paint(2, contrast=1.7, feature_m=0.1, grey=150.0),
    )
    trajectory, when = Trajectory(drive), np.array([3.0])
    ahead = trajectory.forward(when)[0]
    way = math.atan2(-ahead[0], ahead[1]) + math.pi / 2  # to the left
    velocity = 9.0 * np.array([-math.sin(way), math.cos(way)])
    path = tuple(through(trajectory.ground_position(when)[0] + 11.0 * ahead, velocity, 3.0))
    look = Paint(3, contrast=0.22, feature_m=0.3, grey=30.0)
    return replace(drive, boxes=(Box("car", 1.75, 1.45, 4.2, path=path, heading_rad=way, paint=look),))


@pytest.mark.parametrize("turn_radps", [0.0, 0.45])
def test_a_dark_car_that_crosses_is_found_in_a_turn_too_and_nothing_else_moves_fast(turn_radps: float) -> None:
    due = found = 0
    for moment in play_drive(drive := dark_car(turn_radps), config_of(drive), ("filter",)):
        assert moment.truth is not None
        circles = moment.scenes["filter"].circles
        rebel = circles[(circles["kind"] == Kind.REBEL) & (circles["trust"] >= 3) & (circles["speed"] > 100)]
        boxes = [each.box for each in moment.truth.objects if each.in_sight]
        due += len(boxes)
        for circle in rebel:
            assert any(x - 40 < circle["x"] < x + w + 40 and y - 40 < circle["y"] < y + h + 40 for x, y, w, h in boxes)
        found += len(boxes) if len(rebel) else 0
    assert due > 10
    assert found > 0.3 * due
