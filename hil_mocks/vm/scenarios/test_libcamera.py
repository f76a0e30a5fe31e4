"""A camera that only libcamera can run: the kernel's vimc on Debian 13, where libcamera's binding is."""

from collections.abc import Iterator

import pytest

from hil_mocks.vm.conftest import RESULTS, booted
from hil_mocks.vm.daemon import LISTENS, Daemon, Subscriber
from hil_mocks.vm.image import DEBIAN_13_WITH_LIBCAMERA
from hil_mocks.vm.machine import Machine

SYSTEMS = (DEBIAN_13_WITH_LIBCAMERA,)
CAMERA = (
    """[camera]
device = "{device}"
width = 160
height = 120
fps = 1.0

[filter]
corners_target = 150
"""
    + LISTENS
)  # an emulated processor makes one or two images of vimc in a second
BY_HAND = "/opt/lcf-edge/bin/python -m drivers.camera"
LIBCAMERA = f"{BY_HAND}.libcamera 'Sensor B' --width 160 --height 120 --fps 1"
NOBODY = "setpriv --reuid=65534 --regid=65534 --clear-groups"
VIMC = "/sys/bus/platform/drivers/vimc"
BINDING = "/usr/lib/python3/dist-packages/libcamera"
PROCESS = "systemctl show lcf-edge --property=ControlGroup --value | xargs -I{} cat /sys/fs/cgroup/{}/cgroup.procs"


@pytest.fixture(scope="module")
def machine(pytestconfig: pytest.Config) -> Iterator[Machine]:
    """With a camera of the kernel's media controller."""
    with booted(pytestconfig, SYSTEMS[0], RESULTS / "libcamera") as running:
        running.run("modprobe vimc && udevadm settle")
        yield running


def helper(machine: Machine) -> int:
    """The process of the service that runs libcamera."""
    found = machine.run(
        f"for pid in $({PROCESS}); do grep -alq libcamera_process /proc/$pid/cmdline && echo $pid; done"
    )
    return int(found)


@pytest.fixture
def running(daemon: Daemon, subscriber: Subscriber) -> Daemon:
    """The service with the camera, delivering."""
    if daemon.show("ActiveState") != "active":
        daemon.start(CAMERA.format(device="/dev/video0"))
    subscriber.wait_for_status("camera", "delivers")
    return daemon


def test_a_node_that_needs_libcamera_is_run_by_it(running: Daemon, subscriber: Subscriber) -> None:
    """Nothing but the usual device is configured; the driver is found, and so is the camera."""
    subscriber.wait_for_scenes(3)
    scene = subscriber.scenes[-1]
    assert (scene.image_width, scene.image_height) == (160, 120)
    assert subscriber.count("camera", "stamped at arrival") == 0
    assert helper(running.machine) != running.pid


def test_a_crash_of_libcamera_does_not_end_the_daemon(running: Daemon, subscriber: Subscriber) -> None:
    pid = running.pid
    failed = subscriber.count("camera", "failed")
    running.machine.run(f"kill -SEGV {helper(running.machine)}")
    subscriber.wait_for_count("camera", "failed", failed + 1)
    subscriber.wait_for_status("camera", "delivers")
    subscriber.wait_for_scenes(2)
    assert running.pid == pid
    assert "the process that runs libcamera was ended by SIGSEGV" in running.machine.journal()


def test_a_camera_that_goes_comes_back(running: Daemon, subscriber: Subscriber, begun_s: float) -> None:
    pid = running.pid
    running.machine.run(f"echo vimc.0 > {VIMC}/unbind")
    subscriber.wait_for_status("camera", "away since")
    running.machine.run(f"echo vimc.0 > {VIMC}/bind; udevadm settle")
    subscriber.wait_for_status("camera", "delivers")
    subscriber.wait_for_scenes(2)
    assert running.pid == pid
    assert "no permission" not in running.machine.journal(begun_s)  # as until udev has given it to its group


def test_the_process_takes_little_memory(running: Daemon) -> None:
    """Beside the shared memory of the images, and the files that others map as well."""
    taken = running.machine.run(f"grep RssAnon /proc/{helper(running.machine)}/status")
    assert int(taken.split()[1]) < 16_000  # kB


def test_a_camera_that_the_daemon_has_is_busy(running: Daemon) -> None:
    outcome = running.machine.tried(LIBCAMERA)
    assert outcome.status == 1
    assert outcome.output.startswith("Sensor B: in use by another program")
    assert outcome.output.count("\n") == 1


def test_the_doctor_knows_it(running: Daemon) -> None:
    """First while in use by the daemon, then on its own."""
    output = running.machine.tried("lcf-edge doctor 2>&1", 120.0).output
    assert "camera" in output
    assert "in use by the daemon: delivers" in output
    running.stop()
    output = running.machine.tried("lcf-edge doctor 2>&1", 120.0).output
    assert "/dev/video0: through libcamera" in output


@pytest.fixture
def free(daemon: Daemon) -> Machine:
    """The machine while the service does not run."""
    daemon.stop()
    return daemon.machine


def test_it_has_a_name_and_an_id(free: Machine) -> None:
    assert free.run(f"{BY_HAND}.libcamera --list") == "Sensor B: platform/vimc.0 Sensor B"
    output = free.run(f"{BY_HAND}.libcamera vimc.0 --width 160 --height 120 --fps 1 --seconds 8")
    assert "160x120" in output


@pytest.mark.parametrize(
    ("command", "output"),
    [
        (f"{BY_HAND}.v4l2 /dev/video0", "gives images only through libcamera, as ribbon-cable cameras do; set cam"),
        (
            f"{BY_HAND}.libcamera imx219",
            "imx219: libcamera has no such camera; found: Sensor B (platform/vimc.0 Sensor B)",
        ),
        (f"{LIBCAMERA} --width 8000", "Sensor B: no format that can be read of 8000x120; offered: RGB3: "),
        (f"{LIBCAMERA} --gain 2", "Sensor B: camera.gain cannot be set; leave it unset"),
        (
            f"{NOBODY} {LIBCAMERA}",
            "Sensor B: no permission for /dev/media0; ",
        ),
        (f"{NOBODY} {BY_HAND}.libcamera --list", "libcamera: no permission for /dev/media0; "),
        (
            f"mv {BINDING} {BINDING}.away; {LIBCAMERA}; mv {BINDING}.away {BINDING}",
            "apt install python3-libcamera libcamera-ipa",
        ),
        (f"rmmod vimc; {LIBCAMERA}; modprobe vimc", "Sensor B: libcamera finds no camera; check that the ribbon cable"),
    ],
    ids=[
        "the other driver",
        "no such camera",
        "size",
        "lock",
        "no permission",
        "no permission to list",
        "no binding",
        "no camera at all",
    ],
)
def test_what_is_wrong_is_one_line(free: Machine, command: str, output: str) -> None:
    outcome = free.tried(f"cd /tmp; {command}")
    assert output in outcome.output
    assert outcome.output.count("\n") == 1
