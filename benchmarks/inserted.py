"""``python -m benchmarks.inserted RECORDINGS INTO``: recordings with things drawn into their vehicle's way.

Recordings of what is dangerous are few. In these a real vehicle drives its real way, with its own images, IMU and
odometry, at a textured board that was not there: one that stands, that crosses, or that leads at a lower speed, and is
met at a chosen image. ``lcf-edge evaluate INTO`` scores them; all else that moves in them counts as false. The board
follows the vehicle's way by odometry and gyro, and the pitch that these, or else the upper half of the images, show;
where they are wrong, it moves a little.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from benchmarks.copies import copy_all_but_images, lines_of, write_image
from benchmarks.methods import FilterMethod
from benchmarks.playing import lens_of
from drivers.samples import Frame, ImuSample
from lcf_edge.config import Config, load
from lcf_edge.ego_motion.estimator import EgoMotionEstimator
from lcf_edge.errors import LcfError, RecordingError
from lcf_edge.evaluate.corpus import find
from lcf_edge.lens import Lens
from lcf_edge.recording.read import open_recording

Grey = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]

MOTIONS = ("stands", "crosses", "leads")
MET = (0.4, 0.65, 0.9)  # of the recording
CROSSES, LEADS = 0.3, 0.6  # speed, as a share of the vehicle's
WIDE, WIDEST_M = 2.0, 1.2  # half widths of the vehicle
TALL, TALLEST_M = 3.5, 1.7
CONTRAST = 45.0  # grey levels, 1 standard deviation
PITCH_S = 2.0  # the pitch is known less its mean over this time
NEAREST_M = 0.15
MIN_WIDTH_PX = 3.0
STEP_S = 0.05
FINE = 4  # a board is drawn on this many times the pixels


@dataclass(frozen=True, slots=True)
class Way:
    """Where a vehicle is at each image, right and forward of its start.

    ``heading_rad``: to the right. ``pitch_rad``: of the camera, up, less its mean over ``PITCH_S``. ``yaw_rate_radps``:
    to the right.
    """

    time_s: Floats
    x_m: Floats
    z_m: Floats
    heading_rad: Floats
    pitch_rad: Floats
    speed_mps: Floats
    yaw_rate_radps: Floats


@dataclass(frozen=True, slots=True)
class Board:
    """Where a board is at each image, and its velocity over ground, in the axes of the way."""

    width_m: float
    height_m: float
    x_m: Floats
    z_m: Floats
    vx_mps: Floats
    vz_mps: Floats


def _smooth(values: Floats, count: int) -> Floats:
    """Running mean."""
    half = count // 2
    return np.convolve(np.pad(values, half, mode="edge"), np.ones(2 * half + 1) / (2 * half + 1), "valid")


def way_of(path: Path, config: Config, images: Sequence[Grey]) -> tuple[Way, Config, Lens]:
    """The vehicle's way, its configuration with the mounting that the filter learns, and its lens.

    Raises ``RecordingError``.
    """
    recording = open_recording(path, config)
    lens = lens_of(recording, config, *images[0].shape)
    tracker, motion = FilterMethod(config, lens), EgoMotionEstimator(config.imu, config.vehicle)
    turns, speeds, stamps = [], [], []
    for item in recording:
        if isinstance(item, Frame):
            tracker.process(item)
            ego = motion.advance(item.stamp_ns)
            turns.append((np.arctan2(ego.rotation[0, 2], ego.rotation[2, 2]), ego.rotation[1, 2]))
            speeds.append(ego.speed_mps)
            stamps.append(item.stamp_ns)
            continue
        tracker.add(item)
        if isinstance(item, ImuSample):
            motion.add_imu(item)
        else:
            motion.add_speed(item)
    mounted = tracker.pipeline.filter.mounting
    camera = replace(config.camera, pitch_rad=mounted.pitch_rad, yaw_rad=mounted.yaw_rad)
    if not np.isfinite(speeds[1:]).all():
        raise RecordingError(f"{path}: its speed is unknown: things cannot be put in its way")
    time = (np.array(stamps) - stamps[0]) * 1e-9
    turn, speed = np.array(turns), np.nan_to_num(np.array(speeds))
    step, heading = np.diff(time, prepend=time[0]), np.cumsum(-turn[:, 0])
    tilt = turn[:, 1] if turn[:, 1].any() else shown_pitch(images, lens)
    pitch = np.cumsum(tilt)
    pitch -= _smooth(pitch, round(PITCH_S * len(time) / max(time[-1], 1e-9)))
    yaw_rate = _smooth(-turn[:, 0] / np.maximum(step, 1e-3), 5)
    x, z = np.cumsum(speed * np.sin(heading) * step), np.cumsum(speed * np.cos(heading) * step)
    return Way(time, x, z, heading, pitch, speed, yaw_rate), replace(config, camera=camera), lens


def shown_pitch(images: Sequence[Grey], lens: Lens) -> Floats:
    """By how much the camera pitches from each image to the next, by the shift of their upper halves, rad."""
    height, width = images[0].shape
    upper = [image[: height // 2].astype(np.float32) for image in images]
    window = cv2.createHanningWindow((width, height // 2), cv2.CV_32F)
    shifts = [cv2.phaseCorrelate(one, other, window)[0][1] for one, other in pairwise(upper)]
    return np.array([0.0, *shifts]) / lens.fy


def board_for(way: Way, met: int, motion: str, config: Config, side: float) -> Board:
    """The board that is met at image ``met``; ``side``: 1 or -1, to which it crosses."""
    half_m = config.vehicle.half_width_m
    width_m, height_m = min(WIDE * half_m, WIDEST_M), min(TALL * half_m, TALLEST_M)
    x, z, still = np.full_like(way.x_m, way.x_m[met]), np.full_like(way.z_m, way.z_m[met]), np.zeros_like(way.x_m)
    if motion == "leads":
        driven = np.cumsum(way.speed_mps * np.diff(way.time_s, prepend=way.time_s[0]))
        along = driven[met] - LEADS * (driven[met] - driven)
        x, z = np.interp(along, driven, way.x_m), np.interp(along, driven, way.z_m)
        return Board(width_m, height_m, x, z, np.gradient(x, way.time_s), np.gradient(z, way.time_s))
    speed = CROSSES * way.speed_mps[met] * side if motion == "crosses" else 0.0
    vx, vz = speed * np.cos(way.heading_rad[met]), -speed * np.sin(way.heading_rad[met])
    before = way.time_s - way.time_s[met]
    return Board(width_m, height_m, x + vx * before, z + vz * before, still + vx, still + vz)


def seen_from(x_m: float, z_m: float, heading_rad: float) -> tuple[float, float]:
    """To the right of and ahead of a vehicle with that heading, m."""
    sin, cos = np.sin(heading_rad), np.cos(heading_rad)
    return x_m * cos - z_m * sin, x_m * sin + z_m * cos


def corners_px(way: Way, board: Board, n: int, config: Config, lens: Lens) -> Floats | None:
    """Corners of the board in an image, clockwise from the upper left, px (4, 2); None: it is not in view."""
    right, ahead = seen_from(board.x_m[n] - way.x_m[n], board.z_m[n] - way.z_m[n], way.heading_rad[n])
    if ahead < NEAREST_M:
        return None
    half, foot = board.width_m / 2, config.camera.height_m
    x = right + np.array([-half, half, half, -half])
    y, z = foot - board.height_m * np.array([1.0, 1.0, 0.0, 0.0]), np.full(4, ahead)
    yaw, pitch = config.camera.yaw_rad, config.camera.pitch_rad + way.pitch_rad[n]
    x, z = x * np.cos(yaw) - z * np.sin(yaw), z * np.cos(yaw) + x * np.sin(yaw)
    y, z = y * np.cos(pitch) + z * np.sin(pitch), z * np.cos(pitch) - y * np.sin(pitch)
    if z.min() < NEAREST_M:
        return None
    ideal = np.stack([lens.cx + lens.fx * x / z, lens.cy + lens.fy * y / z], axis=1)
    placed = lens.distort(ideal.astype(np.float32)).astype(np.float64)
    low, high = placed.min(axis=0), placed.max(axis=0)
    inside = np.isfinite(placed).all() and (high > 0).all() and low[0] < lens.width and low[1] < lens.height
    return placed if inside and high[0] - low[0] >= MIN_WIDTH_PX else None


def texture(random: np.random.Generator) -> Floats:
    """Patches of grey of several sizes, mean 0, standard deviation 1."""
    layers = (cv2.resize(random.normal(0, 1, (rows, rows // 2)), (96, 192)) for rows in (6, 16, 48))
    grey = np.sum(list(layers), axis=0)
    return np.asarray((grey - grey.mean()) / grey.std(), np.float64)


def drawn(image: Grey, corners: Floats, grey: Floats) -> Grey:
    """The image with the board in it."""
    height, width = image.shape
    size = FINE * width, FINE * height
    source = np.array([[0, 0], [grey.shape[1], 0], grey.shape[::-1], [0, grey.shape[0]]], np.float32)
    matrix = cv2.getPerspectiveTransform(source, ((corners + 0.5) * FINE).astype(np.float32))
    board, share = (
        cv2.resize(cv2.warpPerspective(each, matrix, size), (width, height), interpolation=cv2.INTER_AREA)
        for each in (grey.astype(np.float32), np.ones(grey.shape, np.float32))
    )
    shown = image * (1 - share) + image.mean() * share + CONTRAST * board
    return np.asarray(np.clip(np.round(shown), 0, 255), np.uint8)


def is_met(way: Way, board: Board, n: int, config: Config) -> bool:
    """Whether the board will be met within the horizon if it keeps its velocity, and the vehicle speed and turn."""
    heading, speed = way.heading_rad[n], way.speed_mps[n]
    dx, dz, vx, vz = board.x_m[n] - way.x_m[n], board.z_m[n] - way.z_m[n], board.vx_mps[n], board.vz_mps[n]
    for after_s in np.arange(0, config.vehicle.horizon_s, STEP_S):
        turned = way.yaw_rate_radps[n] * after_s
        along = heading + turned / 2
        x = dx + vx * after_s - speed * after_s * np.sin(along)
        z = dz + vz * after_s - speed * after_s * np.cos(along)
        right, ahead = seen_from(x, z, heading + turned)
        if ahead <= 0:
            return bool(abs(right) < config.vehicle.half_width_m + board.width_m / 4)
    return False


def _truth(way: Way, board: Board, n: int, corners: Floats | None, motion: str, config: Config) -> list[dict[str, Any]]:
    if corners is None:
        return []
    low, high = corners.min(axis=0), corners.max(axis=0)
    box = [round(float(each), 1) for each in (*low, *high)]
    return [{"name": motion, "box": box, "moving": motion != MOTIONS[0], "threat": is_met(way, board, n, config)}]


def write(path: Path, settings: Sequence[str], into: Path) -> Iterator[str]:
    """Write all copies of an ASL recording into a folder; yield the name of each. Raises ``RecordingError``."""
    _, rows = lines_of(path / "mav0/cam0/data.csv")
    names = [Path("mav0/cam0/data", row.split(",")[1].strip()) for row in rows]
    images = [cv2.imread(str(path / name), cv2.IMREAD_GRAYSCALE) for name in names]
    if any(image is None for image in images):
        raise RecordingError(f"{path}: an image cannot be read")
    whole = [np.asarray(image, np.uint8) for image in images]
    way, config, lens = way_of(path, load(None, settings), whole)
    for number, share in enumerate(MET):
        for motion in MOTIONS:
            board = board_for(way, int(share * (len(rows) - 1)), motion, config, 1.0 - 2.0 * (number % 2))
            grey = texture(np.random.default_rng(number))
            copy = into / f"{path.name}@{motion}-{number}"
            copy_all_but_images(path, copy)
            truth = []
            for n, name in enumerate(names):
                corners = corners_px(way, board, n, config, lens)
                write_image(copy / name, whole[n] if corners is None else drawn(whole[n], corners, grey))
                objects = _truth(way, board, n, corners, motion, config)
                truth.append(json.dumps({"stamp_ns": int(rows[n].split(",")[0]), "objects": objects}) + "\n")
            (copy / "truth.jsonl").write_text("".join(truth), "utf-8")
            yield copy.name


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the copies of all recordings; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.inserted", description=__doc__)
    parser.add_argument("recordings", type=Path, help="folder of recordings, each a folder with a file settings")
    parser.add_argument("into", type=Path, help="new folder")
    options = parser.parse_args(arguments)
    written = 0
    try:
        for entry in find([options.recordings]):
            if entry.settings and (entry.path / "mav0/odom0/data.csv").is_file():
                written += sum(1 for _ in write(entry.path, entry.settings, options.into))
    except (LcfError, OSError) as error:
        sys.stderr.write(f"benchmarks.inserted: {error}\n")
        return 1
    sys.stdout.write(f"{written} copies in {options.into}: lcf-edge evaluate {options.into}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
