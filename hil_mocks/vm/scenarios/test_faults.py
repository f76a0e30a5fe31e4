"""What goes wrong around a running daemon: reported as docs/operation.md says, and over by itself."""

from collections.abc import Callable

import pytest

from hil_mocks.vm.daemon import DEFAULT_SETTINGS, STATE, UNIT, Daemon, Subscriber

VIVID = "/sys/bus/platform/drivers/vivid"
STEP_S = 3600.0
RECORDS = '\n[record]\nwhen = "always"\nfree_mib = 4.0\n'


@pytest.fixture(autouse=True)
def started(daemon: Daemon, subscriber: Subscriber) -> Daemon:
    """Running, with frames; started anew only where the last scenario left it otherwise."""
    if daemon.show("ActiveState") != "active" or "imu" in subscriber.statuses:
        daemon.start(DEFAULT_SETTINGS)
    subscriber.wait_for_status("camera", "delivers")
    subscriber.wait_for_scenes()
    return daemon


@pytest.fixture(autouse=True)
def outlived(started: Daemon) -> Callable[[], bool]:
    """Whether it is the same process as at the beginning."""
    pid = started.pid
    return lambda: started.pid == pid


def control(daemon: Daemon, name: str, value: int) -> None:
    """Set a control of the webcam."""
    daemon.machine.run(f"v4l2-ctl --device /dev/video0 --set-ctrl {name}={value}")


def test_the_camera_is_unbound_and_bound_again(
    started: Daemon, subscriber: Subscriber, outlived: Callable[[], bool]
) -> None:
    started.machine.run(f"echo vivid.0 > {VIVID}/unbind")
    subscriber.wait_for_status("camera", "away since")
    assert started.machine.run("systemctl show lcf-edge -p StatusText").startswith("StatusText=no camera")
    started.machine.run(f"echo vivid.0 > {VIVID}/bind; udevadm settle")
    subscriber.wait_for_status("camera", "delivers")
    subscriber.wait_for_scenes()
    assert subscriber.count("camera", "opened") >= 2
    assert outlived()


def test_the_camera_disconnects(started: Daemon, subscriber: Subscriber, outlived: Callable[[], bool]) -> None:
    failed = subscriber.count("camera", "failed")
    control(started, "disconnect", 1)
    subscriber.wait_for_count("camera", "failed", failed + 1)
    subscriber.wait_for_status("camera", "delivers")
    subscriber.wait_for_scenes()
    assert outlived()


def test_corrupt_buffers_are_refused_and_counted(
    started: Daemon, subscriber: Subscriber, outlived: Callable[[], bool]
) -> None:
    corrupt = subscriber.count("camera", "corrupt")
    control(started, "inject_v4l2_buf_flag_error", 1)
    subscriber.wait_for_count("camera", "corrupt", corrupt + 1)
    subscriber.wait_for_scenes()
    assert outlived()


def test_dropped_buffers_are_counted(started: Daemon, subscriber: Subscriber, outlived: Callable[[], bool]) -> None:
    dropped = subscriber.count("camera", "dropped")
    control(started, "percentage_of_dropped_buffers", 30)
    subscriber.wait_for_count("camera", "dropped", dropped + 3)
    control(started, "percentage_of_dropped_buffers", 0)
    subscriber.wait_for_scenes()
    assert outlived()


def test_the_system_clock_is_set(started: Daemon, subscriber: Subscriber, outlived: Callable[[], bool]) -> None:
    steps = subscriber.count("pipeline", "clock_steps")
    before_ns = subscriber.scenes[-1].stamp_ns
    started.machine.run(f"date --set='+{STEP_S:.0f} seconds'")
    subscriber.wait_for_count("pipeline", "clock_steps", steps + 1)
    subscriber.wait_for_scenes(2)
    assert -1 < (subscriber.scenes[-1].stamp_ns - before_ns) / 1e9 - STEP_S < 120
    started.machine.run(f"date --set='-{STEP_S:.0f} seconds'")
    subscriber.wait_for_count("pipeline", "clock_steps", steps + 2)
    subscriber.wait_for_scenes(2)
    assert (subscriber.scenes[-1].stamp_ns - before_ns) / 1e9 < 240
    assert outlived()


def test_the_network_goes_and_comes_back(started: Daemon, subscriber: Subscriber, outlived: Callable[[], bool]) -> None:
    frames = subscriber.count("pipeline", "scenes")
    started.machine.run("ip link set eth0 down; sleep 5")
    received = len(subscriber.scenes)
    started.machine.run("sleep 5")
    assert len(subscriber.scenes) == received
    started.machine.run("ip link set eth0 up; networkctl reconfigure eth0")
    subscriber.wait_for_scenes()
    subscriber.wait_for_count("pipeline", "scenes", frames + 10)
    assert outlived()


def test_the_disk_fills_up_while_it_records(daemon: Daemon, subscriber: Subscriber) -> None:
    daemon.stop()
    daemon.machine.run(f"mount -t tmpfs -o size=24m,mode=750 tmpfs {STATE}")
    try:
        daemon.start(DEFAULT_SETTINGS + RECORDS)
        subscriber.wait_for_count("recorder", "pictures")
        daemon.machine.run(f"fallocate -l 18M {STATE}/filler")
        subscriber.wait_for_status("recorder", "cannot be written")
        subscriber.wait_for_scenes()
        frame_count = subscriber.count("recorder", "pictures")
        daemon.machine.run(f"rm {STATE}/filler")
        subscriber.wait_for_status("recorder", "records into")
        subscriber.wait_for_count("recorder", "pictures", frame_count + 1)
        assert daemon.restarts == 0
    finally:
        daemon.stop()
        daemon.machine.run(f"umount {STATE}")


def test_a_processor_that_others_have_costs_images_that_are_counted(
    started: Daemon, subscriber: Subscriber, outlived: Callable[[], bool]
) -> None:
    quota = f"systemctl set-property --runtime {UNIT} CPUQuota="

    def lost() -> int:
        """Images that came and were not looked at: where depends on which thread had to wait."""
        return sum(subscriber.count("camera", how) for how in ("dropped", "overtaken", "overtaken before the pipeline"))

    before = lost()
    started.machine.run(quota + "10%")  # less than the images cost
    try:
        subscriber.wait_for(lambda: lost() > before, "an image is lost and counted")
    finally:
        started.machine.run(quota)
    subscriber.wait_for_scenes()
    assert outlived()
