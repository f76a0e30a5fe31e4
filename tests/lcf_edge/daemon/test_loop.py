"""The pipeline's thread: every frame becomes a scene on the system clock, or is counted."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Camera, Config, Filter, Memory, Vehicle
from lcf_edge.daemon.clock import StoppableClock, SystemTime
from lcf_edge.daemon.loop import Loop, Mail
from lcf_edge.daemon.outputs import Outputs
from lcf_edge.daemon.preview import Previewer
from lcf_edge.daemon.scenes import LinkedScenes
from lcf_edge.errors import ConfigError
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording
from lcf_edge.sinks.sink import Sink
from lcf_edge.zenoh_link import MAX_MESSAGE_BYTES

PATIENCE_S = 20.0

Start = Callable[..., Loop]


@pytest.fixture
def mail() -> Mail:
    return Mail()


@pytest.fixture
def start(link: Any, mail: Mail) -> Iterator[Start]:
    """A running loop with its scenes and previews."""
    clock = StoppableClock()
    started: list[tuple[Loop, Outputs]] = []

    def begin(config: Config, system_time: SystemTime | None = None, more: Sequence[Sink] = ()) -> Loop:
        outputs = Outputs([LinkedScenes(link), Previewer(link), *more])
        loop = Loop(config, mail, link, outputs, clock, system_time or SystemTime(), lambda: None)
        started.append((loop, outputs))
        outputs.start()
        loop.start()
        return loop

    yield begin
    clock.stop()
    for loop, outputs in started:
        loop.wake()
        loop.join(PATIENCE_S)
        assert not loop.is_alive()
        outputs.close()
        outputs.join(PATIENCE_S)


@pytest.fixture
def plain() -> Config:
    return Config(camera=Camera(width=320, height=240))


def test_live_is_the_same_as_replay(config: Config, start: Start, mail: Mail, link: Any) -> None:
    recording = open_recording(Path(config.camera.recording), config)
    replayed = [outcome.scene for _, outcome in run(recording, config)]
    start(config)
    for item in recording:
        if isinstance(item, Frame):
            wanted = len(link.scenes) + 1
            mail.frames.put(item)
            link.wait_for(lambda wanted=wanted: len(link.scenes) == wanted)
        elif isinstance(item, ImuSample):
            mail.imu.put([item])
        else:
            mail.speeds.put([item])
    assert mail.frames.overtaken == mail.imu.overtaken == mail.speeds.overtaken == 0
    for live, before in zip(link.scenes, replayed, strict=True):
        assert live.seq == before.seq
        assert live.circles.tobytes() == before.circles.tobytes()
        assert live.psi.tobytes() == before.psi.tobytes()
        assert live.notes == before.notes


def test_stamps_are_of_the_system_clock(plain: Config, start: Start, mail: Mail, link: Any, approach: Any) -> None:
    start(plain)
    before_ns, now_ns, after_ns = time.time_ns(), time.monotonic_ns(), time.time_ns()
    mail.frames.put(Frame(now_ns, 0, approach().image(0)))
    link.wait_for(lambda: link.scenes)
    assert before_ns - 10**6 <= link.scenes[0].stamp_ns <= after_ns + 10**6


def test_stamps_follow_a_step_of_the_system_clock_and_it_is_reported(
    plain: Config, start: Start, mail: Mail, link: Any, approach: Any, caplog: pytest.LogCaptureFixture
) -> None:
    ahead_ns = 0
    start(plain, SystemTime(time.monotonic_ns, lambda: time.time_ns() + ahead_ns))
    stamps_ns = [time.monotonic_ns(), time.monotonic_ns() + 50_000_000]
    mail.frames.put(Frame(stamps_ns[0], 0, approach().image(0)))
    link.wait_for(lambda: len(link.scenes) == 1)
    ahead_ns = 3600 * 10**9
    threading.Event().wait(0.3)  # a turn without a frame sees it too
    mail.frames.put(Frame(stamps_ns[1], 1, approach().image(1)))
    link.wait_for(lambda: len(link.scenes) == 2)
    step_ns = link.scenes[1].stamp_ns - link.scenes[0].stamp_ns - (stamps_ns[1] - stamps_ns[0])
    assert abs(step_ns - ahead_ns) < 10**6
    assert [record.getMessage() for record in caplog.records] == [
        "clock: the system clock was set by +3600.000 s; stamps follow"
    ]


def test_a_frame_that_is_overtaken_is_counted(
    plain: Config, start: Start, mail: Mail, link: Any, approach: Any
) -> None:
    loop = start(plain)
    begin_ns, image = time.monotonic_ns(), approach().image(0)
    link.held.clear()
    mail.frames.put(Frame(begin_ns, 0, image))
    link.wait_for(lambda: len(link.scenes) == 1)  # in whose put the loop is held
    for seq in range(1, 10):
        mail.frames.put(Frame(begin_ns + seq * 10**7, seq, image))
    link.held.set()
    link.wait_for(lambda: link.scenes[-1].seq == 9)
    assert [scene.seq for scene in link.scenes] == [0, 9]
    assert mail.frames.overtaken == 8
    assert loop.latency.percentile_s(100) > 0


def test_progress_goes_on_without_frames_and_stops_when_the_loop_is_held(
    plain: Config, start: Start, mail: Mail, link: Any, approach: Any
) -> None:
    loop = start(plain)
    idle = threading.Event()
    while loop.turns < 2:
        idle.wait(0.01)
    link.held.clear()
    mail.frames.put(Frame(time.monotonic_ns(), 0, approach().image(0)))
    link.wait_for(lambda: link.scenes)
    turns = loop.turns
    idle.wait(0.6)
    assert loop.turns == turns
    link.held.set()


def test_speeds_of_the_link_are_taken_in_the_sender_s_time(
    plain: Config, start: Start, mail: Mail, link: Any, approach: Any
) -> None:
    plain = msgspec.structs.replace(plain, vehicle=Vehicle(speed_source="odometry"))
    start(plain)
    for seq in range(3):
        now_ns = time.monotonic_ns()
        link.speeds.append((now_ns, SpeedSample(time.time_ns(), 1.25, 0.0)))
        mail.frames.put(Frame(now_ns + 10**6, seq, approach().image(seq)))
        link.wait_for(lambda seq=seq: len(link.scenes) == seq + 1)
    assert link.scenes[-1].vehicle_speed == pytest.approx(1.25)


def test_without_speed_ranges_are_unknown(plain: Config, start: Start, mail: Mail, link: Any, approach: Any) -> None:
    loop = start(plain)
    begin_ns = time.monotonic_ns()
    for seq in range(12):
        mail.frames.put(Frame(begin_ns + seq * 50_000_000, seq, approach().image(seq)))
        link.wait_for(lambda seq=seq: len(link.scenes) == seq + 1)
    assert np.isnan([scene.vehicle_speed for scene in link.scenes]).all()
    assert all(np.isnan(scene.circles["range"]).all() for scene in link.scenes)
    kinds = [note.partition(":")[0] for note in loop.degradation.notes]
    assert kinds == ["no inertial samples", "speed is unknown"]


def test_a_rebuilt_pipeline_takes_over_with_the_next_frame(
    plain: Config, start: Start, mail: Mail, link: Any, noise: Any
) -> None:
    loop = start(plain)
    image = noise(width=320, height=240)
    mail.frames.put(Frame(time.monotonic_ns(), 0, image))
    link.wait_for(lambda: len(link.scenes) == 1)
    mail.imu.put([ImuSample(0, (np.nan, 0, 0), (0, 0, 0))])
    loop.rebuild(msgspec.structs.replace(plain, memory=Memory(corners=50)))
    mail.frames.put(Frame(time.monotonic_ns(), 1, image))
    link.wait_for(lambda: len(link.scenes) == 2)
    assert [scene.sizes.corners for scene in link.scenes] == [1500, 50]
    with pytest.raises(ConfigError):
        loop.rebuild(
            msgspec.structs.replace(plain, camera=Camera(width=640, height=640, intrinsics=[500, 500, 320, 320]))
        )


def test_what_earlier_pipelines_refused_is_not_forgotten(
    plain: Config, start: Start, mail: Mail, link: Any, approach: Any
) -> None:
    loop = start(plain)
    for seq in range(2):
        mail.imu.put([ImuSample(0, (float("nan"), 0, 0), (0, 0, 0))])
        loop.rebuild(plain)
        mail.frames.put(Frame(time.monotonic_ns(), seq, approach().image(seq)))
        link.wait_for(lambda seq=seq: len(link.scenes) == seq + 1)
    assert loop.refused == {"imu not finite": 2}


def test_images_of_another_size_get_a_pipeline_of_their_own(start: Start, mail: Mail, link: Any, noise: Any) -> None:
    start(Config(filter=Filter()))
    for seq, (width, height) in enumerate(((640, 480), (320, 240))):
        mail.frames.put(Frame(time.monotonic_ns(), seq, noise(width=width, height=height)))
        link.wait_for(lambda seq=seq: len(link.scenes) == seq + 1)
    assert [(scene.image_width, scene.image_height) for scene in link.scenes] == [(640, 480), (320, 240)]


def test_a_pipeline_that_was_rebuilt_for_another_size_than_the_images_then_have_is_not_used(
    plain: Config, start: Start, mail: Mail, link: Any, noise: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def first_image_comes(*_: object) -> None:
        mail.frames.put(Frame(time.monotonic_ns(), 0, noise(0, 160, 120)))
        link.wait_for(lambda: len(link.scenes) == 1)

    monkeypatch.setattr("lcf_edge.daemon.loop.try_out", first_image_comes)
    start(plain).rebuild(plain)
    for seq in (1, 2):
        mail.frames.put(Frame(time.monotonic_ns(), seq, noise(seq, 160, 120)))
        link.wait_for(lambda seq=seq: len(link.scenes) == seq + 1)
    assert {(scene.image_width, scene.image_height) for scene in link.scenes} == {(160, 120)}


def test_a_preview_is_drawn_only_while_somebody_looks(
    plain: Config, start: Start, mail: Mail, link: Any, approach: Any
) -> None:
    start(plain)
    for seq, looks in enumerate((False, True)):
        link.looks = looks
        mail.frames.put(Frame(time.monotonic_ns(), seq, approach().image(seq)))
        link.wait_for(lambda seq=seq: len(link.scenes) == seq + 1)
    link.wait_for(lambda: link.previews)
    ((jpeg, stamp_ns),) = link.previews
    assert stamp_ns == link.scenes[1].stamp_ns
    assert np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)).shape == (240, 640, 3)


def test_a_preview_of_a_large_camera_fits_into_a_message(start: Start, mail: Mail, link: Any, noise: Any) -> None:
    start(Config(camera=Camera(width=1920, height=1080)))
    link.looks = True
    mail.frames.put(Frame(time.monotonic_ns(), 0, noise(width=1920, height=1080)))
    link.wait_for(lambda: link.previews)
    ((jpeg, _),) = link.previews
    assert len(jpeg) < MAX_MESSAGE_BYTES
    assert np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)).shape == (540, 1920, 3)
