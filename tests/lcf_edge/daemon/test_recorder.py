"""The recorder: all that the pipeline took and made is in the file, or counted; the pipeline never waits for it."""

import os
import resource
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
import pytest
from mcap.reader import make_reader

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.cdr import decode_scene
from lcf_edge.config import Config, Memory, load
from lcf_edge.config import Record as RecordTable
from lcf_edge.daemon import disk_writer
from lcf_edge.daemon.clock import StoppableClock, SystemTime
from lcf_edge.daemon.lenses import known_lens
from lcf_edge.daemon.loop import Loop, Mail
from lcf_edge.daemon.outputs import Outputs
from lcf_edge.daemon.recorder import INBOX_BYTES, Recorder
from lcf_edge.daemon.scenes import LinkedScenes
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Kind, PipelineScene, Scene
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording
from lcf_edge.recording.write.destination import MIB, Folder

PATIENCE_S = 20.0
STEP_NS = 50_000_000
MESSAGES_OF_ONE = 5  # of an image: itself, its lens, its scene, what is drawn in it and in space
MESSAGES_OF_A_SECOND = 2  # the diagnostics, and where the camera sits

Begin = Callable[..., Recorder]


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Begin]:
    """A running recorder of ``[record]``; in the end closed, when all must be written."""
    recorders: list[Recorder] = []

    def begin(system_time: SystemTime | None = None, destination: Any = None, **record: Any) -> Recorder:
        table = RecordTable(**({"when": "always", "folder": str(tmp_path), "free_mib": 0} | record))
        recorder = Recorder(
            Config(record=table), destination or Folder(table), system_time or SystemTime(), lambda *_: None
        )
        recorder.start()
        recorders.append(recorder)
        return recorder

    yield begin
    for recorder in recorders:
        recorder.close()
        assert recorder.join(PATIENCE_S)


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk is synced, and asked again after a failure, without delay."""
    monkeypatch.setattr(disk_writer, "SYNC_S", 0.02)
    monkeypatch.setattr(disk_writer, "RETRY_S", 0.02)


def seen(
    seq: int,
    ttc_s: float = np.inf,
    width: int = 64,
    stamp_ns: int | None = None,
    objects: npt.NDArray[np.void] | None = None,
) -> tuple[Frame, PipelineScene, Any]:
    """An image of noise, 3/4 of which is its width high, and a rebel circle, which belongs to the objects' first."""
    height = width * 3 // 4
    stamp_ns = 10**12 + seq * STEP_NS if stamp_ns is None else stamp_ns
    circle = np.zeros(1, CIRCLE)
    circle["kind"], circle["ttc"] = Kind.REBEL, ttc_s
    image = np.random.default_rng(seq).integers(0, 256, (height, width), np.uint8)
    objects = np.empty(0, OBJECT) if objects is None else objects
    owner = np.resize(objects["id"], 1) if len(objects) else np.zeros(1, np.uint32)
    scene = PipelineScene(
        stamp_ns, seq, width, height, 1.0, circle, np.empty(0, PSI_REGION), objects=objects, circle_objects=owner
    )
    return Frame(stamp_ns, seq, image), scene, None


def until(happened: Callable[[], object]) -> None:
    """Look again and again."""
    end_s, pause = time.monotonic() + PATIENCE_S, threading.Event()
    while not happened():
        assert time.monotonic() < end_s
        pause.wait(0.005)


def ended(recorder: Recorder) -> DeviceStatus:
    """Close it, and how it was in the end."""
    recorder.close()
    assert recorder.join(PATIENCE_S)
    return recorder.status()


def scenes_in(folder: Path) -> list[list[Scene]]:
    """The scenes of each file, in the order of the files."""
    found = []
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as file:
            messages = make_reader(file).iter_messages("/lcf/scene", log_time_order=False)
            found.append([decode_scene(message.data) for _, _, message in messages])
    return found


def test_a_replay_of_what_it_wrote_finds_what_was_found_live(config: Config, tmp_path: Path, link: Any) -> None:
    table = RecordTable(when="always", folder=str(tmp_path), free_mib=0, format="png")
    config = msgspec.structs.replace(config, record=table)
    clock, system_time, mail = StoppableClock(), SystemTime(), Mail()
    recorder = Recorder(config, Folder(table), system_time, known_lens)
    outputs = Outputs([LinkedScenes(link), recorder])
    loop = Loop(config, mail, link, outputs, clock, system_time, lambda: None)
    recorder.start()
    loop.start()
    source = open_recording(Path(config.camera.recording), config)
    given: Counter[type] = Counter()
    first_ns = next(iter(source)).stamp_ns
    for recorded in source:
        item = replace(recorded, stamp_ns=recorded.stamp_ns - first_ns + 10**12)
        given[type(item)] += 1
        if isinstance(item, Frame):
            mail.frames.put(item)
            link.wait_for(lambda: len(link.scenes) == given[Frame])
        else:
            (mail.imu if isinstance(item, ImuSample) else mail.speeds).put([item])  # type: ignore[list-item]
    until(lambda: loop.turns >= given[Frame])
    clock.stop()
    loop.wake()
    loop.join(PATIENCE_S)
    assert ended(recorder).values["dropped before encoding"] == "0"

    (path,) = tmp_path.glob("*.mcap")
    written = load(path)
    assert written == config
    again = open_recording(path, written)
    assert again.lens == source.lens
    replayed = [outcome.scene for _, outcome in run(again, written)]
    (live,) = scenes_in(tmp_path)
    assert len(live) == len(replayed) == given[Frame]
    for before, now in zip(live, replayed, strict=True):
        assert now.circles.tobytes() == before.circles.tobytes()
        assert now.psi.tobytes() == before.psi.tobytes()
        assert now.objects.tobytes() == before.objects.tobytes()
        assert now.stamp_ns == before.stamp_ns
    assert again.warnings == []
    assert not again.skipped


class Stuck(Folder):
    """A disk that takes nothing while it is held."""

    def __init__(self, table: RecordTable) -> None:
        super().__init__(table)
        self.free = threading.Event()

    def next(self, system_ns: int) -> Path:
        self.free.wait(PATIENCE_S)
        return super().next(system_ns)


def test_a_disk_that_hangs_costs_messages_that_are_counted_and_nothing_grows(tmp_path: Path, begin: Begin) -> None:
    disk = Stuck(RecordTable(folder=str(tmp_path)))
    recorder = begin(destination=disk, buffer_mib=1)
    count = 300
    for seq in range(count):
        recorder.put(*seen(seq, width=320))
        recorder.put_sample(ImuSample(10**12 + seq * STEP_NS, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        held_bytes = float(recorder.status().values["held_mib"]) * MIB
        assert held_bytes <= INBOX_BYTES + 1.01 * MIB
    until(lambda: int(recorder.status().values["dropped before the disk"]) > 0)
    disk.free.set()
    status = ended(recorder)
    values = {name: int(value) for name, value in status.values.items() if value.isdigit()}
    (scenes,) = scenes_in(tmp_path)
    assert values["messages"] + values["dropped before the disk"] == MESSAGES_OF_ONE * (
        count - _dropped_pictures(recorder)
    ) + (count - (values["dropped before encoding"] - _dropped_pictures(recorder)))
    assert [scene.seq for scene in scenes] == sorted({scene.seq for scene in scenes})
    assert values["pictures"] < count


def _dropped_pictures(recorder: Recorder) -> int:
    """Images that the inbox did not take: samples always fit into its reserve here."""
    return recorder._inbox.dropped


def test_samples_still_fit_where_images_do_not(tmp_path: Path, begin: Begin) -> None:
    disk = Stuck(RecordTable(folder=str(tmp_path)))
    recorder = begin(destination=disk, buffer_mib=4)
    for seq in range(200):
        recorder.put(*seen(seq, width=320))
    for seq in range(100):
        recorder.put_sample(SpeedSample(10**12 + seq, 1.0, 0.0))
    until(lambda: recorder._inbox.bytes == 0)
    disk.free.set()
    ended(recorder)
    assert recorder.dropped > 0
    (path,) = tmp_path.iterdir()
    with path.open("rb") as file:
        assert len(list(make_reader(file).iter_messages("/lcf/speed"))) == 100


def test_a_step_of_the_clock_leaves_the_time_of_a_file_alone(tmp_path: Path, begin: Begin) -> None:
    ahead_ns = 0
    system_time = SystemTime(time.monotonic_ns, lambda: time.time_ns() + ahead_ns)
    recorder = begin(system_time)
    recorder.put(*seen(0))
    until(lambda: recorder.frames == 1)
    ahead_ns = -3600 * 10**9
    assert system_time.notice()
    recorder.put(*seen(1))
    ended(recorder)
    ((first, second),) = scenes_in(tmp_path)
    assert second.stamp_ns - first.stamp_ns == STEP_NS
    assert first.stamp_ns == pytest.approx(time.time_ns() - time.monotonic_ns() + 10**12, abs=10**9)


# Threats.


def test_the_seconds_before_and_after_a_threat_are_saved(tmp_path: Path, begin: Begin) -> None:
    recorder = begin(when="threat", before_s=0.5, after_s=0.25, ttc_s=1.5)
    waited = recorder.status()
    threats = {20: 1.4, 22: 0.3, 60: 1.0}
    for seq in range(80):
        recorder.put(*seen(seq, threats.get(seq, 1.5)))
    status = ended(recorder)
    assert waited.message == "waits for a threat"
    assert status.values["threats"] == "2"
    assert [[scene.seq for scene in scenes] for scenes in scenes_in(tmp_path)] == [
        list(range(9, 28)),  # half a second before the image with the circle, a quarter after the second one
        list(range(49, 66)),
    ]


def test_a_normal_circle_is_no_threat(tmp_path: Path, begin: Begin) -> None:
    recorder = begin(when="threat")
    frame, scene, view = seen(0, 0.1)
    scene.circles["kind"] = Kind.NORMAL
    recorder.put(frame, scene, view)
    ended(recorder)
    assert scenes_in(tmp_path) == []


@pytest.mark.parametrize(("probability", "files"), [(0.8, 1), (0.2, 0)])
def test_where_there_is_an_object_it_decides_whether_it_threatens_and_not_its_circles(
    tmp_path: Path, begin: Begin, probability: float, files: int
) -> None:
    walker = np.zeros(1, OBJECT)
    walker["id"], walker["ttc"], walker["probability"] = 7, 1.0, probability
    recorder = begin(when="threat", ttc_s=1.5)
    recorder.put(*seen(0, 0.3, objects=walker))
    ended(recorder)
    assert len(scenes_in(tmp_path)) == files


def test_a_threat_ends_without_images_too(begin: Begin) -> None:
    recorder = begin(when="threat", after_s=1.0)
    recorder.put(*seen(0, 0.5))
    for seq in range(5):
        recorder.put_diagnostics(10**12 + seq * 10**9, [DeviceStatus("camera", Level.ERROR, "away")])
    until(lambda: recorder.status().values["files"] == "1" and recorder.status().message == "waits for a threat")
    assert recorder.status().values["messages"] == str(MESSAGES_OF_ONE + 2 * MESSAGES_OF_A_SECOND)


def test_what_waits_for_a_threat_is_bounded_and_can_be_given_up(tmp_path: Path, begin: Begin) -> None:
    recorder = begin(when="threat", before_s=100, buffer_mib=2)
    for seq in range(150):
        recorder.put(*seen(seq, width=320))
        until(lambda: recorder._inbox.bytes == 0)
    assert 1.5 <= float(recorder.status().values["held_mib"]) <= 2
    recorder.shed()
    recorder.put(*seen(150, width=320))
    until(lambda: float(recorder.status().values["held_mib"]) <= 1)
    assert recorder.dropped == 0  # what nobody wanted saved is not lost
    recorder.put(*seen(151, 0.5))
    ended(recorder)
    ((*_, last),) = scenes_in(tmp_path)
    assert last.seq == 151


# The disk.


@pytest.mark.usefixtures("often")
def test_at_its_size_a_file_ends_and_the_oldest_gives_way(tmp_path: Path, begin: Begin) -> None:
    recorder = begin(file_mib=1, total_mib=3)
    for seq in range(60):
        recorder.put(*seen(seq, width=320))
        until(lambda: recorder._inbox.bytes == recorder._backlog.bytes == 0)
    status = ended(recorder)
    assert status.values["files"] == str(int(status.values["files removed"]) + len(scenes_in(tmp_path)))
    assert int(status.values["files removed"]) > 0
    numbers = [scene.seq for scenes in scenes_in(tmp_path) for scene in scenes]
    assert numbers == list(range(numbers[0], 60))
    assert all(path.stat().st_size < 2 * MIB for path in tmp_path.iterdir())
    assert recorder.dropped == 0


@pytest.mark.usefixtures("often")
def test_a_file_with_the_largest_of_numbers_does_not_end_the_pruning(tmp_path: Path, begin: Begin) -> None:
    (tmp_path / f"lcf-edge-{'9' * 18}-20260101T000000Z.mcap").touch()
    recorder = begin(file_mib=1, total_mib=3)
    for seq in range(60):
        recorder.put(*seen(seq, width=320))
        until(lambda: recorder._inbox.bytes == recorder._backlog.bytes == 0)
    assert int(ended(recorder).values["files removed"]) > 1  # not the one alone


@pytest.mark.usefixtures("often")
def test_at_its_age_a_file_ends(tmp_path: Path, begin: Begin) -> None:
    recorder = begin(file_s=0.01)
    for seq in range(5):
        recorder.put(*seen(seq))
        until(lambda seq=seq: recorder.frames == seq + 1 and recorder.status().message.startswith("waits"))
    files = scenes_in(tmp_path)
    assert len(files) >= 5
    assert [scene.seq for scenes in files for scene in scenes] == list(range(5))


@contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    folder.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", folder], check=False, capture_output=True)
    if done.returncode:
        pytest.skip("no disk of our own can be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount a disk")
@pytest.mark.usefixtures("often")
def test_a_full_disk_is_reported_once_and_the_file_goes_on_when_there_is_room(
    tmp_path: Path, begin: Begin, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "lcf_edge")
    with small_disk(tmp_path / "disk") as disk:
        (disk / "others").write_bytes(bytes(MIB))
        recorder = begin(folder=str(disk))
        seqs = iter(range(1000))

        def more_until(happened: Callable[[], object]) -> None:
            def step() -> object:
                recorder.put(*seen(next(seqs), width=160))
                return happened()

            until(step)

        more_until(lambda: recorder.status().level is Level.WARN)
        assert "No space left on device" in recorder.status().message
        more_until(lambda: int(recorder.status().values["lost to the disk"]) > 10)
        (disk / "others").unlink()
        more_until(lambda: recorder.status().level is Level.OK)
        last = next(seqs)
        recorder.put(*seen(last, width=160))
        ended(recorder)
        ((*_, final),) = scenes_in(disk)  # one file, whole
        assert final.seq == last
    logged = [record.getMessage() for record in caplog.records]
    assert len([line for line in logged if "cannot be written" in line]) == 1
    assert [line.split()[1] for line in logged] == ["records", str(disk / logged[0].split("/")[-1]) + ":", "continues"]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount a disk")
@pytest.mark.usefixtures("often")
def test_a_disk_that_is_full_from_the_start_gets_no_empty_files(tmp_path: Path, begin: Begin) -> None:
    with small_disk(tmp_path / "disk") as disk:
        (disk / "others").write_bytes(bytes(2 * MIB))
        recorder = begin(folder=str(disk))
        until(lambda: recorder.put(*seen(0)) or int(recorder.status().values["lost to the disk"]) > 5)
        assert [path.name for path in disk.iterdir()] == ["others"]
        (disk / "others").unlink()
        until(lambda: recorder.put(*seen(1)) or recorder.frames > 0)
        ended(recorder)
        assert len(scenes_in(disk)) == 1


@pytest.mark.usefixtures("often")
def test_a_file_that_must_not_grow_is_followed_by_another(tmp_path: Path, begin: Begin) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    recorder = begin()
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, before[1]))
    try:
        until(lambda: recorder.put(*seen(0, width=160)) or recorder.status().values["files"] == "3")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    ended(recorder)
    first, *_ = sorted(tmp_path.glob("*.mcap"))
    assert open_recording(first, Config()).lens is None
    assert first.stat().st_size <= 200_000


@pytest.mark.usefixtures("often")
def test_room_for_others_is_left(tmp_path: Path, begin: Begin) -> None:
    recorder = begin(free_mib=10**9)
    until(lambda: recorder.put(*seen(0)) or recorder.status().level is Level.WARN)
    assert "less than record.free_mib = 1e+09 MiB are free" in recorder.status().message
    ended(recorder)
    assert list(tmp_path.iterdir()) == []
    assert recorder.dropped > 0


@pytest.mark.usefixtures("often")
def test_a_file_that_somebody_removes_is_followed_by_another(tmp_path: Path, begin: Begin) -> None:
    recorder = begin()
    recorder.put(*seen(0))
    until(lambda: recorder.frames == 1)
    next(tmp_path.glob("*.mcap")).unlink()
    until(lambda: recorder.put(*seen(1)) or recorder.status().values["files"] == "2")
    ended(recorder)
    assert len(scenes_in(tmp_path)) == 1


def test_what_fits_no_message_is_counted(begin: Begin) -> None:
    recorder = begin()
    recorder.put_sample(ImuSample(-(2**62), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    recorder.put_sample(SpeedSample(5, 1.0, 0.0))
    status = ended(recorder)
    assert (status.values["unfit"], status.values["messages"]) == ("1", "1")


def test_a_new_configuration_is_attached(tmp_path: Path, begin: Begin) -> None:
    recorder = begin()
    recorder.put(*seen(0))
    until(lambda: recorder.frames == 1)
    recorder.show_config(Config(memory=Memory(corners=77)))
    recorder.put(*seen(1))
    ended(recorder)
    (path,) = tmp_path.glob("*.mcap")
    with path.open("rb") as file:
        texts = [one.data.decode() for one in make_reader(file).iter_attachments()]
    assert ["corners = 77" in text for text in texts] == [False, True]
