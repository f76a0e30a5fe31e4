"""From pictures to circles: rendered drives against their truth, and a real one where nothing threatens."""

import os
from pathlib import Path

import numpy as np
import pytest

from benchmarks.score import Score, score
from hil_mocks import scenes
from lcf_edge.config import Camera, Config, Vehicle
from lcf_edge.lens import Lens
from lcf_edge.pipeline import Pipeline, run
from lcf_edge.recordings import open_recording
from lcf_edge.records import Kind

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


def test_on_a_real_street_where_nothing_moves_there_are_hardly_any_rebels() -> None:
    folder = DATA / "kitti-straight"
    if not folder.is_dir():
        pytest.skip("no real recordings here; set LCF_EDGE_DATA")
    config = Config(camera=Camera(height_m=1.65), vehicle=Vehicle(half_width_m=1.2, horizon_s=4.0))
    rebels = [
        np.count_nonzero(outcome.scene.circles["kind"] == Kind.REBEL)
        for _, outcome in run(open_recording(folder, config), config)
    ]
    assert len(rebels) > 40
    assert np.mean(rebels) <= 0.15
