"""From images to circles: rendered drives against their truth, and a real one where nothing threatens."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.score import Score, score
from drivers.samples import Frame, SpeedSample
from lcf_edge.config import Camera, Config, Imu, Vehicle
from lcf_edge.lens import Lens
from lcf_edge.messages import Kind
from lcf_edge.pipeline import Pipeline
from lcf_edge.recording.read import open_recording
from lcf_edge.rendered import scenes

DATA = Path(os.environ.get("LCF_EDGE_DATA", Path(__file__).parents[4] / "shared" / "data"))


def replayed(kind: str, seed: int, seconds: float = 3.0) -> Score:
    drive = scenes.make(kind, seed, seconds=seconds)
    camera = Camera(height_m=drive.camera_height_m, pitch_rad=drive.camera_pitch_rad)
    config = Config(camera=camera, vehicle=Vehicle(half_width_m=drive.half_width_m, horizon_s=drive.horizon_s))
    fx, fy, cx, cy = drive.lens.matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    pipeline = Pipeline(config, Lens(drive.lens.width, drive.lens.height, fx, fy, cx, cy))
    samples = sorted([*scenes.imu(drive), *scenes.odometry(drive)], key=lambda sample: sample.stamp_ns, reverse=True)
    results, truths = [], []
    for frame, truth in scenes.frames(drive):
        while samples and samples[-1].stamp_ns <= frame.stamp_ns + 20_000_000:
            pipeline.add(samples.pop())
        results.append(pipeline.process(frame))
        truths.append(truth)
    return score(results, truths)


@pytest.mark.parametrize("kind", ["crossing", "ahead"])
def test_what_threatens_is_found_and_never_ignored(kind: str) -> None:
    result = replayed(kind, seed=0)
    assert result.hits + result.misses >= 20
    assert result.recall >= 0.8
    assert result.false_circles <= 0.1 * result.frames
    assert result.psi_on_threat_frames == 0


def test_among_what_passes_nothing_is_taken_for_a_threat() -> None:
    result = replayed("passing", seed=0)
    assert result.frames >= 50
    assert result.false_per_quiet_frame <= 0.1
    assert result.corners_omitted > 0


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"pitch_rad": 0.035},
        {"pitch_rad": -0.035},
        {"yaw_rad": 0.035},
        {"yaw_rad": -0.035},
        {"focal": 1.05},
        {"focal": 0.95},
        {"imu_s": 0.01},
        {"imu_s": -0.01},
        {"speed": 1.1},
        {"speed": 0.9},
    ],
    ids=str,
)
def test_on_a_real_street_where_nothing_moves_there_are_no_rebels_however_it_is_calibrated(
    wrong: dict[str, float],
) -> None:
    """Two degrees, 5 % of the focal length, 10 ms, 10 % of the speed."""
    folder = DATA / "kitti-straight"
    if not folder.is_dir():
        pytest.skip("no real recordings here; set LCF_EDGE_DATA")
    camera = Camera(height_m=1.65, pitch_rad=wrong.get("pitch_rad", 0.0), yaw_rad=wrong.get("yaw_rad", 0.0))
    imu, vehicle = Imu(time_offset_s=wrong.get("imu_s", 0.0)), Vehicle(half_width_m=1.2, horizon_s=4.0)
    config = Config(camera=camera, vehicle=vehicle, imu=imu)
    recording = open_recording(folder, config)
    lens = recording.lens
    assert lens is not None
    lens = replace(lens, fx=lens.fx * wrong.get("focal", 1.0), fy=lens.fy * wrong.get("focal", 1.0))
    pipeline, rebels = Pipeline(config, lens), []
    for item in recording:
        if isinstance(item, Frame):
            rebels.append(np.count_nonzero(pipeline.process(item).circles["kind"] == Kind.REBEL))
        elif isinstance(item, SpeedSample):
            pipeline.add(replace(item, speed_mps=item.speed_mps * wrong.get("speed", 1.0)))
        else:
            pipeline.add(item)
    assert len(rebels) > 40
    assert np.mean(rebels) <= 0.05
