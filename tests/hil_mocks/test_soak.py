"""The soak: what it reckons, its stand-ins, and a short one of the real daemon."""

import math
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import DeviceLostError, DeviceMissingError
from drivers.samples import Frame
from hil_mocks.soak import stand_ins
from hil_mocks.soak.__main__ import main, soak
from hil_mocks.soak.figures import Balance, Life, complaints, lines, slope
from hil_mocks.soak.stand_ins import FastCamera, FastImu, FastSpeed, Feed, save
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.rendered import scenes


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of 10 images."""
    path = tmp_path_factory.mktemp("drive") / "drive.npz"
    save(scenes.make("crossing", 1, seconds=0.5, fps=20.0, width=64, height=48, focal_px=50.0), path)
    return path


@pytest.fixture
def feed(drive: Path, monkeypatch: pytest.MonkeyPatch) -> Feed:
    """One without faults."""
    monkeypatch.setattr(stand_ins.Feed, "fault", lambda *_args, **_named: "")
    return Feed(drive, 1, 1_000_000_000)


def status(name: str, message: str = "", **values: object) -> DeviceStatus:
    texts = {key.replace("_", " ") if key.startswith("overtaken") else key: str(value) for key, value in values.items()}
    return DeviceStatus(name, Level.OK, message, texts)


def parts(delivered: int, put: int, overtaken: int, mib: float, message: str = "") -> dict[str, DeviceStatus]:
    return {
        "camera": status("camera", delivered=delivered, overtaken_before_the_pipeline=overtaken),
        "pipeline": status("pipeline", scenes=put),
        "memory": status("memory", message, resident_mib=mib),
    }


# What is reckoned.


@given(st.floats(-5, 5), st.lists(st.floats(50, 150), min_size=1, max_size=4))
def test_the_slope_is_that_of_all_lives_whatever_each_begins_with(rise: float, begins: list[float]) -> None:
    lives = [[(frames, mib + rise * frames / 100_000) for frames in range(0, 50_000, 500)] for mib in begins]
    found, sigma = slope(lives)
    assert found == pytest.approx(rise, abs=1e-6)
    assert sigma < 1e-3


@given(st.integers(0, 2**32))
def test_the_slope_is_within_its_error(seed: int) -> None:
    random = np.random.default_rng(seed)
    mib = 80 + 2.0 * np.arange(0, 100_000, 500) / 100_000 + random.normal(0, 0.3, 200)
    found, sigma = slope([list(zip(range(0, 100_000, 500), mib.tolist(), strict=True))])
    assert abs(found - 2.0) < 5 * sigma
    assert sigma < 0.5


def test_steps_that_stay_widen_the_error() -> None:
    frames = range(0, 100_000, 500)
    random = np.random.default_rng(1)
    shaken = random.normal(0, 0.3, len(frames))
    stepped = np.repeat(shaken[::20], 20)
    (_, loose), (_, tight) = (slope([list(zip(frames, mib.tolist(), strict=True))]) for mib in (stepped, shaken))
    assert loose > 2 * tight


def test_what_is_used_while_it_warms_up_is_no_growth() -> None:
    memory = [(frames, min(60 + frames / 100, 80.0)) for frames in range(0, 50_000, 500)]
    assert slope([memory])[0] == pytest.approx(0, abs=1e-9)


def test_too_little_has_no_slope() -> None:
    assert all(map(math.isnan, slope([[(0, 80.0), (100, 80.0)]])))
    assert all(map(math.isnan, slope([])))


def test_an_image_that_nothing_tells_of_is_lost() -> None:
    assert Balance.of(parts(100, 90, 10, 80)).lost == 0
    assert Balance.of(parts(100, 90, 9, 80)).lost == 1


def test_a_life_keeps_memory_and_complains() -> None:
    life = Life(1, end="SIGTERM", ended_s=2.5, seconds=10.0)
    for second in range(10):
        life.note(parts(100 * second + 1, 100 * second, 0, 80 + second, "gave up the preview"))
    assert life.memory[-1] == (900, 89.0)
    texts = complaints([life], 1.0)
    assert [what in line for what, line in zip(("1 images lost", "gave up", "2.5 s", "grows"), texts, strict=True)]
    assert any("901 delivered, 900 put, 0 overtaken, 1 lost" in line for line in lines([life]))


# The stand-ins.


def test_images_come_as_fast_as_they_are_taken_in_their_own_time(feed: Feed) -> None:
    camera = FastCamera(feed)
    frames: list[Frame] = []
    for _ in range(25):
        frames += camera.read()
        feed.taken()
    assert [frame.seq for frame in frames] == list(range(25))
    assert [frame.stamp_ns for frame in frames] == [1_000_000_000 + 50_000_000 * seq for seq in range(25)]
    assert np.array_equal(frames[3].image, frames[13].image)
    assert camera.counts["delivered"] == 25


def test_none_comes_before_the_last_was_taken_nor_in_a_pause(feed: Feed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_ins, "WAIT_S", 0.01)
    camera = FastCamera(feed)
    assert len(camera.read()) == 1
    assert camera.read() == []
    feed.taken()
    feed.pause_or_go_on()
    assert camera.read() == []
    feed.pause_or_go_on()
    assert len(camera.read()) == 1


def test_samples_reach_beyond_each_image_and_go_on_over_the_laps(feed: Feed) -> None:
    camera, imu, speed = FastCamera(feed), FastImu(feed), FastSpeed(feed)
    stamps: list[int] = []
    for _ in range(25):
        (frame,) = camera.read()
        stamps += [sample.stamp_ns for sample in imu.read()]
        assert stamps[-1] > frame.stamp_ns
        feed.taken()
    assert set(np.diff(stamps).tolist()) == {5_000_000}
    assert len(speed.read()) == pytest.approx(1.2 * 50, abs=1)


def test_faults_are_those_of_their_seed_and_numbers_only_grow(drive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_ins, "CAMERA_FAULT_EACH", 100)

    def driven(seed: int) -> tuple[list[int], dict[str, int]]:
        feed = Feed(drive, seed, 0)
        seqs: list[int] = []
        camera: FastCamera | None = None
        while len(seqs) < 3_000:
            try:
                camera = camera or FastCamera(feed)
                seqs += [frame.seq for frame in camera.read()]
            except (DeviceMissingError, DeviceLostError):
                camera = None
            feed.taken()
        return seqs, dict(feed.faults)

    seqs, faults = driven(1)
    assert driven(1) == (seqs, faults)
    assert driven(2) != (seqs, faults)
    assert {f"camera {kind}" for kind in (*stand_ins.CAMERA_FAULTS, "missing")} == faults.keys()
    assert all(np.diff(seqs) >= 1)


def test_it_can_be_waited_for_in_another_thread(feed: Feed) -> None:
    imu = FastImu(feed)
    imu.read()
    got: list[int] = []
    reader = threading.Thread(target=lambda: got.extend(sample.stamp_ns for sample in imu.read() or imu.read()))
    reader.start()
    FastCamera(feed).read()
    reader.join(10)
    assert got


# All of it.


def test_a_short_soak_loses_nothing(tmp_path: Path) -> None:
    (life,) = soak(30, 60.0, 1, 1, tmp_path)
    assert life.balance.put >= 30
    assert life.balance.lost == 0
    assert life.end == "SIGTERM"
    assert life.received > 0


def test_what_is_typed_wrong_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for wrong in ([], ["--frames", "0"], ["--frames", "5", "--minutes", "1"]):
        with pytest.raises(SystemExit) as end:
            main(wrong)
        assert end.value.code == 2
    assert "usage" in capsys.readouterr().err
