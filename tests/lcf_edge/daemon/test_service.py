"""The whole daemon in this process, but for Zenoh and signals."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader

from lcf_edge.compilation import uncompiled
from lcf_edge.config import Camera, Config, Imu, Memory, Record, Vehicle, load, to_toml
from lcf_edge.daemon import health, loop, service
from lcf_edge.daemon.board import Board
from lcf_edge.daemon.loop import Loop
from lcf_edge.daemon.notify import Notifier
from lcf_edge.daemon.service import InternalError, Service
from lcf_edge.diagnostics import Level
from lcf_edge.errors import ConfigError
from lcf_edge.pipeline import Pipeline
from lcf_edge.recording.playback import RecordedCamera
from lcf_edge.rendered import scenes
from tests.emulation import needs_the_processor

PATIENCE_S = 20.0
TICK_S = 0.1

Start = Callable[..., Service]


class Runs:
    """Services that run in a thread each, stopped in the end."""

    def __init__(self, link: Any, manager: Any) -> None:
        self._link, self._manager = link, manager
        self._pool = ThreadPoolExecutor()
        self.services: list[tuple[Service, Future[None]]] = []

    def start(self, config: Config, path: Path | None = None) -> Service:
        begun = Service(config, self._link, path, (), Notifier(self._manager.environment), TICK_S)
        self.services.append((begun, self._pool.submit(begun.run)))
        return begun

    def failure(self) -> BaseException | None:
        """How the last one ended."""
        return self.services[-1][1].exception(PATIENCE_S)

    def end(self) -> None:
        for begun, ended in self.services:
            begun.stop("test")
            ended.exception(PATIENCE_S)
        self._pool.shutdown()


@pytest.fixture
def runs(link: Any, manager: Any) -> Iterator[Runs]:
    runs = Runs(link, manager)
    yield runs
    link.held.set()
    runs.end()


def written(folder: Path, config: Config) -> Path:
    """A configuration in a file, replaced at once."""
    (folder / "new").write_text(to_toml(config))
    (folder / "new").replace(folder / "config.toml")
    return folder / "config.toml"


# Start, progress, end.


def test_ready_when_frames_flow_and_closed_in_order(config: Config, runs: Runs, link: Any, manager: Any) -> None:
    begun = runs.start(config)
    manager.until("READY=1")
    assert link.scenes
    while "circles" not in (status := manager.until("STATUS=")[-1]):
        pass
    assert " frames/s, " in status
    assert status.endswith(" MiB")
    begun.stop("test")
    manager.until("STOPPING=1")
    assert runs.failure() is None
    assert link.closed == 1
    assert {"camera", "imu", "speed", "pipeline"}.isdisjoint(thread.name for thread in threading.enumerate())


def test_without_a_camera_it_is_ready_once_that_is_reported(runs: Runs, link: Any, manager: Any) -> None:
    runs.start(Config(camera=Camera(device="/dev/no-such-camera")))
    messages = manager.until("READY=1")
    assert any("no camera" in message and "/dev/no-such-camera" in message for message in messages)
    link.wait_for(lambda: link.statuses and link.statuses["camera"].message.startswith("away since 2"))
    assert link.statuses["camera"].level is Level.ERROR
    assert "/dev/no-such-camera" in link.statuses["camera"].message
    assert link.scenes == []
    manager.until("WATCHDOG=1")  # waiting for a camera is progress


def test_the_watchdog_is_fed_by_the_progress_of_the_pipeline(
    config: Config, runs: Runs, link: Any, manager: Any
) -> None:
    runs.start(config)
    manager.until("WATCHDOG=1")
    link.held.clear()
    manager.until("STATUS=")
    messages = [message for _ in range(6) for message in manager.until("STATUS=")]
    assert "WATCHDOG=1" not in messages[4:]  # the last turn may have been just before
    link.held.set()
    manager.until("WATCHDOG=1")


def test_a_configuration_that_does_not_fit_the_images_ends_it(config: Config, runs: Runs, link: Any) -> None:
    camera = msgspec.structs.replace(config.camera, width=640, height=640, intrinsics=[500, 500, 320, 320])
    runs.start(msgspec.structs.replace(config, camera=camera))
    failure = runs.failure()
    assert isinstance(failure, ConfigError)
    assert "camera.intrinsics" in str(failure)
    assert link.closed == 1


def test_a_mistake_in_the_program_ends_it_in_one_line(
    config: Config, runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(Loop, "_feed", fail)
    runs.start(config)
    failure = runs.failure()
    assert isinstance(failure, InternalError)
    assert str(failure).startswith("pipeline: internal error: ZeroDivisionError (division by zero) at test_service.py:")
    assert failure.exit_status == 1


# Nothing is lost unseen.


def test_every_frame_is_a_scene_or_counted(
    config: Config, runs: Runs, link: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Slow(RecordedCamera):
        def read(self) -> Any:
            seen.append(super().read())
            return seen[-1]

    seen: list[Any] = []
    monkeypatch.setattr("lcf_edge.recording.playback.RecordedCamera", Slow)
    begun = runs.start(config)
    for _ in range(5):
        wanted = len(link.scenes) + 3
        link.wait_for(lambda wanted=wanted: len(link.scenes) >= wanted)
        link.held.clear()
        threading.Event().wait(0.15)  # frames overtake each other
        link.held.set()
    begun.stop("test")
    assert runs.failure() is None
    delivered = [frame.seq for frames in seen for frame in frames]
    scenes = [scene.seq for scene in link.scenes]
    overtaken = begun._mail.frames.overtaken
    left_over = begun._mail.frames.take(0) is not None
    assert overtaken > 0
    assert len(delivered) == len(scenes) + overtaken + left_over
    lost_before = begun._readers[0].counts["overtaken"]
    assert delivered[-1] - delivered[0] + 1 == len(delivered) + lost_before


# Health.


def test_diagnostics_report_each_part(config: Config, runs: Runs, link: Any) -> None:
    runs.start(config)
    link.wait_for(lambda: link.statuses and int(link.statuses["pipeline"].values["scenes"]) > 20)
    assert {"camera", "imu", "speed", "pipeline", "memory", "board", "link"} == set(link.statuses)
    camera, imu, pipeline = (link.statuses[name] for name in ("camera", "imu", "pipeline"))
    assert camera.level is imu.level is Level.OK
    assert {"jitter_ms", "age_s", "opened", "overtaken before the pipeline"} <= camera.values.keys()
    assert 0 < float(pipeline.values["latency_p50_ms"]) <= float(pipeline.values["latency_p99_ms"])
    assert pipeline.values["corners_fill"].endswith("/1500")
    assert pipeline.values["objects_fill"].endswith("/24")
    assert pipeline.values["evicted"] == "0"
    assert 0 < float(pipeline.values["camera_pitch_sigma_rad"]) <= 0.06
    assert abs(float(pipeline.values["camera_pitch_rad"])) < 0.2
    assert abs(float(pipeline.values["camera_yaw_rad"])) < 0.2
    assert pipeline.values["filter"] == ("uncompiled" if uncompiled() else "compiled")
    assert float(link.statuses["memory"].values["resident_mib"]) > 10


@needs_the_processor("20 images and 200 samples a second are too many for it")
def test_a_rolling_shutter_is_told_with_its_readout_time(config: Config, runs: Runs, link: Any, tmp_path: Path) -> None:
    drive = scenes.make("rolling_shutter", 1, seconds=6.0, width=320, height=240, focal_px=250.0)
    camera = msgspec.structs.replace(config.camera, recording=str(scenes.write(drive, tmp_path / "drive")))
    runs.start(msgspec.structs.replace(config, camera=camera))
    link.wait_for(lambda: link.statuses and "camera_readout_ms" in link.statuses["pipeline"].values)
    values = link.statuses["pipeline"].values
    sigma_ms = float(values["camera_readout_sigma_ms"])
    assert abs(float(values["camera_readout_ms"]) - 1e3 * drive.readout_s) < 4 * sigma_ms
    link.wait_for(lambda: "rolling shutter: " in link.statuses["pipeline"].message)


@needs_the_processor("20 images and 200 samples a second are too many for it")
def test_diagnostics_report_how_often_devices_deliver(config: Config, runs: Runs, link: Any) -> None:
    runs.start(config)
    link.wait_for(lambda: link.statuses and int(link.statuses["pipeline"].values["scenes"]) > 20)
    assert float(link.statuses["camera"].values["rate_hz"]) == pytest.approx(20, rel=0.05)
    assert float(link.statuses["imu"].values["rate_hz"]) == pytest.approx(200, rel=0.05)


def test_when_no_more_sessions_are_let_in_that_is_reported(config: Config, runs: Runs, link: Any) -> None:
    runs.start(config)
    link.wait_for(lambda: link.statuses)
    assert link.statuses["link"].level is Level.OK
    link.sessions = 2
    link.wait_for(lambda: link.statuses["link"].level is Level.WARN)
    assert link.statuses["link"].message == "2 sessions: no more are let in"
    assert link.statuses["link"].values["sessions"] == "2"


def test_an_imu_that_is_away_widens_and_is_reported(config: Config, runs: Runs, link: Any) -> None:
    runs.start(msgspec.structs.replace(config, imu=Imu(driver="csv", port="/dev/no-such-port")))
    link.wait_for(lambda: link.statuses and link.statuses["pipeline"].level is Level.WARN and link.scenes)
    assert link.statuses["imu"].level is Level.WARN
    assert "/dev/no-such-port" in link.statuses["imu"].message
    assert "no inertial samples" in link.statuses["pipeline"].message
    assert "no imu" in link.scenes[-1].notes


# Memory.


def test_over_the_mark_it_gives_up_the_preview_then_corners_and_says_so(
    config: Config, runs: Runs, link: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(service, "ResidentMemory", lambda: lambda: 1050.0)
    link.looks = True
    runs.start(config)
    link.wait_for(lambda: link.statuses and "half of the corners" in link.statuses["memory"].message)
    assert link.statuses["memory"].level is Level.WARN
    assert link.statuses["memory"].message == "gave up the preview, half of the corners"
    messages = [record.getMessage() for record in caplog.records if record.getMessage().startswith("memory: ")]
    assert ["the preview" in messages[0], "half of the corners" in messages[1]] == [True, True]
    link.wait_for(lambda: link.statuses["pipeline"].values["corners_fill"].endswith("/750"))
    previews, scenes = len(link.previews), len(link.scenes)
    link.wait_for(lambda: len(link.scenes) > scenes + 5)
    assert len(link.previews) == previews


def test_the_recording_buffer_goes_before_the_corners(
    config: Config, runs: Runs, link: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service, "ResidentMemory", lambda: lambda: 1050.0)
    runs.start(msgspec.structs.replace(config, record=Record(when="threat", folder=str(tmp_path))))
    link.wait_for(lambda: link.statuses and "corners" in link.statuses["memory"].message)
    given_up = "gave up the preview, most of the recording buffer, half of the corners"
    assert link.statuses["memory"].message == given_up


# Recording.


def test_what_it_records_is_reported_and_closed_at_the_end(
    config: Config, runs: Runs, link: Any, tmp_path: Path
) -> None:
    record = Record(when="always", folder=str(tmp_path), free_mib=0)
    begun = runs.start(msgspec.structs.replace(config, record=record))
    link.wait_for(lambda: link.statuses and int(link.statuses["recorder"].values["pictures"]) > 5)
    (path,) = tmp_path.glob("*.mcap")
    assert link.statuses["recorder"].message == f"records into {path}"
    assert link.statuses["recorder"].level is Level.OK
    begun.stop("test")
    assert runs.failure() is None
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    counts = {summary.channels[n].topic: count for n, count in summary.statistics.channel_message_counts.items()}
    assert counts["/lcf/scene"] == counts["/lcf/camera/image_raw/compressed"] == len(link.scenes)
    assert counts["/lcf/diagnostics"] > 0


def test_a_disk_that_takes_nothing_costs_the_recording_only(
    config: Config, runs: Runs, link: Any, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    record = Record(when="always", folder=str(tmp_path / "file"))
    runs.start(msgspec.structs.replace(config, record=record))
    link.wait_for(lambda: link.statuses and link.statuses["recorder"].level is Level.WARN)
    assert str(tmp_path / "file") in link.statuses["recorder"].message
    scenes = len(link.scenes)
    link.wait_for(lambda: len(link.scenes) > scenes + 10)


# Reload.


def test_a_changed_file_is_read_again(
    config: Config, runs: Runs, link: Any, manager: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "lcf_edge")
    runs.start(config, written(tmp_path, config))
    manager.until("READY=1")
    wanted = msgspec.structs.replace(
        config, memory=Memory(budget_mib=1000, corners=60), camera=msgspec.structs.replace(config.camera, fps=7)
    )
    written(tmp_path, wanted)
    manager.until("RELOADING=1")
    manager.until("READY=1")
    link.wait_for(lambda: link.scenes and 0 < link.scenes[-1].sizes.corners <= 60)
    assert link.config == msgspec.structs.replace(wanted, camera=config.camera)
    messages = [record.getMessage() for record in caplog.records]
    assert "reload: changed memory.corners" in messages
    assert "reload: camera.fps cannot change while running; restart to change it" in messages


def test_a_broken_file_changes_nothing(
    config: Config, runs: Runs, link: Any, manager: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = written(tmp_path, config)
    begun = runs.start(config, path)
    manager.until("READY=1")
    path.write_text("[filter\n")
    begun.reload()
    manager.until("RELOADING=1")
    manager.until("READY=1")
    scenes = len(link.scenes)
    link.wait_for(lambda: len(link.scenes) > scenes + 3)
    (message,) = {record.getMessage() for record in caplog.records if record.getMessage().startswith("reload: ")}
    assert message.endswith("; keeping the old configuration")
    assert str(path) in message


@pytest.mark.parametrize("content", ["", " \n\n", None], ids=["emptied", "blank", "removed"])
def test_a_file_that_is_emptied_changes_nothing(
    config: Config,
    runs: Runs,
    manager: Any,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    content: str | None,
) -> None:
    path = written(tmp_path, config)
    begun = runs.start(config, path)
    manager.until("READY=1")
    if content is None:
        path.unlink()
    else:
        path.write_text(content)
    begun.reload()
    manager.until("RELOADING=1")
    manager.until("READY=1")
    (message,) = {record.getMessage() for record in caplog.records if record.getMessage().startswith("reload: ")}
    assert message.endswith("; keeping the old configuration")
    assert str(path) in message
    assert begun._config == config


def test_a_file_of_the_machine_that_is_emptied_changes_nothing_but_one_that_never_was_is_not_missed(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lcf_edge.config.config.DEFAULT_PATH", tmp_path / "config.toml")
    assert load() == Config()
    for content in ("", None):
        with pytest.raises(ConfigError, match=r"config\.toml: (empty|cannot be read)"):
            load(filled=True)
        if content is not None:
            (tmp_path / "config.toml").write_text(content)
    written(tmp_path, config)
    assert load(filled=True) == config


REMAINS = {
    "gain": "[camera]\ngain = " + "9" * 400,
    "distortion": "[camera]\ndistortion_model = 'radial-tangential'\ndistortion = [0.1, 1e-320, 0, 1e-320]",
    "leap_px": "[filter]\nleap_px = 1e12",
    "bl0_px": "[filter]\nbl0_px = 1e12",
    "bs_px": "[filter]\nbs_px = 1e160",
    "exposure_s": "[camera]\nexposure_s = 1e308",
    "dots": "a." * 20_000 + "a = 1",
    "bytes": "\x00",
}


@pytest.mark.parametrize("name", REMAINS)
def test_a_reload_with_what_cannot_be_leaves_the_pipeline_running(
    config: Config, runs: Runs, link: Any, manager: Any, tmp_path: Path, name: str
) -> None:
    path = written(tmp_path, config)
    begun = runs.start(config, path)
    manager.until("READY=1")
    path.write_text(REMAINS[name] + "\n")
    begun.reload()
    manager.until("RELOADING=1")
    manager.until("READY=1")
    scenes = len(link.scenes)
    link.wait_for(lambda: len(link.scenes) > scenes + 5)


@pytest.mark.parametrize("broken", ["__init__", "process"])
def test_a_pipeline_that_fails_does_not_take_the_place_of_the_old_one(
    config: Config,
    runs: Runs,
    link: Any,
    manager: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    broken: str,
) -> None:
    """However it fails, a mistake in the program is reported in one line."""
    path = written(tmp_path, config)
    begun = runs.start(config, path)
    manager.until("READY=1")

    class Broken(Pipeline):
        pass

    def fail(*_: object) -> None:
        raise ZeroDivisionError("division by zero")

    setattr(Broken, broken, fail)
    monkeypatch.setattr(loop, "Pipeline", Broken)
    written(tmp_path, msgspec.structs.replace(config, vehicle=Vehicle(half_width_m=0.7)))
    begun.reload()
    manager.until("RELOADING=1")
    manager.until("READY=1")
    scenes = len(link.scenes)
    link.wait_for(lambda: len(link.scenes) > scenes + 5)
    (message,) = {record.getMessage() for record in caplog.records if record.getMessage().startswith("reload: ")}
    assert message == (
        "reload: internal error: ZeroDivisionError('division by zero'); please report it; keeping the old configuration"
    )
    assert begun._config == config


def test_a_reload_gives_back_what_was_given_up(
    config: Config, runs: Runs, link: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    resident_mib = 1050.0
    monkeypatch.setattr(service, "ResidentMemory", lambda: lambda: resident_mib)
    begun = runs.start(config, written(tmp_path, config))
    link.wait_for(lambda: link.statuses and "half of the corners" in link.statuses["memory"].message)
    resident_mib = 50.0
    begun.reload()
    link.wait_for(lambda: link.statuses["memory"].level is Level.OK)
    link.wait_for(lambda: link.statuses["pipeline"].values["corners_fill"].endswith("/1500"))


def test_a_camera_that_falls_silent_is_stale(
    config: Config, runs: Runs, link: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    silent = threading.Event()

    class Mute(RecordedCamera):
        def read(self) -> Any:
            frames = super().read()
            return [] if silent.is_set() else frames

    monkeypatch.setattr("lcf_edge.recording.playback.RecordedCamera", Mute)
    runs.start(config)
    link.wait_for(lambda: len(link.scenes) > 3)
    silent.set()
    link.wait_for(lambda: link.statuses["camera"].level is Level.STALE)
    assert link.statuses["camera"].message.startswith("silent since 2")


def test_a_board_that_is_hot_is_reported(
    config: Config, runs: Runs, link: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(health, "read_board", lambda _: Board(91.0, ("cpufreq-cpu0",)))
    runs.start(config)
    link.wait_for(lambda: link.statuses)
    assert link.statuses["board"].level is Level.WARN
    assert link.statuses["board"].message == "slowed down: cpufreq-cpu0; cool it"
    assert link.statuses["board"].values == {"temperature_c": "91.0"}
