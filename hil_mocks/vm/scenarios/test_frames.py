"""Chosen images through real V4L2: an HDMI output feeds the capture device that the daemon reads.

What the daemon took and found is in its own recording; the images in it are those that were put in, and a plain
replay of them finds the same circles.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from mcap.reader import make_reader

from drivers.samples import Frame
from hil_mocks.vm.daemon import LISTENS, Daemon
from hil_mocks.vm.machine import Machine
from lcf_edge.cdr import decode_scene
from lcf_edge.config import load
from lcf_edge.messages import Scene
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording
from lcf_edge.rendered import scenes

FPS = 24.0  # a rate that HDMI has
WIDTH, HEIGHT, FOCAL_PX = 320, 180, 250.0
STILL = 48  # times the first image, while the daemon looks
HELD = 10  # times each: an emulated processor takes a few in a second
CONFIG = f"""
[camera]
device = "{{device}}"
width = {WIDTH}
height = {HEIGHT}
fps = {FPS}
intrinsics = [{FOCAL_PX}, {FOCAL_PX}, {WIDTH / 2 - 0.5}, {HEIGHT / 2 - 0.5}]

[vehicle]
speed_source = "constant"
speed_mps = 0.1

[filter]
corners_target = 150

[record]
when = "always"
format = "png"
free_mib = 16.0
"""
MIN_FRAMES = 20
SAME_PX = 0.5
MIN_SHARE_OF_SAME = 0.9  # of the circles; processors round differently

Grey = npt.NDArray[np.uint8]


def node(machine: Machine, name: str) -> str:
    """The device node of that name."""
    found = machine.run(f"grep -l '^{name}$' /sys/class/video4linux/*/name")
    return f"/dev/{Path(found).parent.name}"


@pytest.fixture(scope="module")
def fed() -> list[Grey]:
    """The images of a drive."""
    drive = scenes.make("crossing", 3, seconds=3.0, fps=FPS, width=WIDTH, height=HEIGHT, focal_px=FOCAL_PX)
    return [frame.image for frame, _ in scenes.frames(drive)]


@pytest.fixture(scope="module")
def recorded(machine: Machine, daemon: Daemon, fed: list[Grey]) -> Iterator[Path]:
    """What the daemon recorded while the drive was on the wire."""
    grabber, player = node(machine, "vivid-001-vid-cap"), node(machine, "vivid-001-vid-out")
    shown = [fed[0]] * STILL + [image for image in fed for _ in range(HELD)]
    (machine.share / "drive.raw").write_bytes(b"".join(image.tobytes() for image in shown))
    listed = machine.run(f"v4l2-ctl --device {player} --list-dv-timings")
    wanted = re.search(
        r"Index: (\d+)\s+Active width: 1280\s+Active height: 720\s(?:(?!Index).)*?\(24\.00 f", listed, re.S
    )
    assert wanted, listed
    for device in (grabber, player):
        machine.run(f"v4l2-ctl --device {device} --set-dv-bt-timings index={wanted[1]}")
    controls = machine.run(f"v4l2-ctl --device {grabber} --list-ctrls")
    cable = "loop_video=1" if "loop_video" in controls else "hdmi_001_0_is_connected_to=2"  # from Linux 6.12 on
    machine.run(f"v4l2-ctl --device {grabber} --set-ctrl {cable},osd_text_mode=2")
    play = (
        f"v4l2-ctl --device {player} --set-fmt-video-out=width={WIDTH},height={HEIGHT},pixelformat=GREY "
        f"--stream-out-mmap --stream-from=/run/drive.raw --stream-count={len(shown)}"
    )
    daemon.start(CONFIG.format(device=grabber) + LISTENS)
    machine.run(f"cp /mnt/drive.raw /run/ && {play}", 120)
    daemon.stop()
    machine.run("mv /var/lib/private/lcf-edge/*.mcap /mnt/drive.mcap && chmod 644 /mnt/drive.mcap")
    yield machine.share / "drive.mcap"
    machine.run("rm -f /run/drive.raw")


def frames_of(recording: Path) -> list[Frame]:
    """Those that the pipeline took."""
    return [item for item in open_recording(recording, load(recording)) if isinstance(item, Frame)]


def test_images_come_unchanged_and_in_order(recorded: Path, fed: list[Grey]) -> None:
    numbers = {image.tobytes(): number for number, image in enumerate(fed)}
    found = [numbers.get(frame.image.tobytes()) for frame in frames_of(recorded)]
    known = [number for number in found if number is not None]
    assert len(set(known)) >= MIN_FRAMES
    assert known == sorted(known)
    first, last = found.index(known[0]), len(found) - found[::-1].index(known[-1])
    assert None not in found[first:last]


def test_the_daemon_finds_what_a_plain_replay_finds(recorded: Path) -> None:
    config = load(recorded)
    replayed = {frame.stamp_ns: outcome.scene for frame, outcome in run(open_recording(recorded, config), config)}
    with recorded.open("rb") as file:
        published = [decode_scene(message.data) for _, _, message in make_reader(file).iter_messages(["/lcf/scene"])]
    assert len(published) >= MIN_FRAMES
    assert {scene.stamp_ns for scene in published} <= replayed.keys()
    same, circles = map(sum, zip(*(found_again(scene, replayed[scene.stamp_ns]) for scene in published), strict=True))
    assert circles > len(published)
    assert same / circles >= MIN_SHARE_OF_SAME


def found_again(scene: Scene, other: Scene) -> tuple[int, int]:
    """How many circles of one scene the other has too, of how many."""
    there = np.stack([other.circles[name] for name in ("x", "y", "radius")], axis=1).astype(np.float64)
    count = 0
    for circle in scene.circles:
        off = np.abs(there - [circle["x"], circle["y"], circle["radius"]]).max(axis=1, initial=0)
        count += bool(((off < SAME_PX) & (other.circles["kind"] == circle["kind"])).any())
    return count, len(scene.circles)
