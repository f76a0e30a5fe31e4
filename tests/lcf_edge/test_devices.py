"""What the configuration names is what is opened."""

import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import get_args

import cv2
import numpy as np
import pytest

from drivers.camera import find, libcamera
from drivers.camera.luminance import PIXEL_FORMATS
from drivers.errors import DeviceMissingError, DriverError
from drivers.imu.registry import DRIVERS, names
from drivers.samples import Frame, ImuSample, SpeedSample
from hil_mocks.libcamera_device import World, command
from hil_mocks.virtual_clock import VirtualClock
from lcf_edge.config import Config, ImuDriver, load
from lcf_edge.config.config import PixelFormat
from lcf_edge.devices import open_camera, open_imu, open_speed


def write_recording(folder: Path, *, imu: bool = True) -> Path:
    """Two images, and two samples of IMU and odometry, of the same times."""
    times = (0, 50_000_000)
    rows = {"cam0": [f"{t},{t}.png" for t in times]}
    if imu:
        rows |= {"imu0": [f"{t},0,0,0,0,-9.81,0" for t in times], "odom0": [f"{t},1.5,0" for t in times]}
    (folder / "mav0/cam0/data").mkdir(parents=True)
    for sensor, lines in rows.items():
        (folder / "mav0" / sensor).mkdir(exist_ok=True)
        (folder / "mav0" / sensor / "data.csv").write_text("#timestamp [ns],…\n" + "\n".join(lines) + "\n")
    for t in times:
        cv2.imwrite(str(folder / f"mav0/cam0/data/{t}.png"), np.zeros((24, 32), np.uint8))
    return folder


def configured(*settings: str) -> Config:
    return load(None, settings)


def test_a_recording_stands_in_for_camera_imu_and_odometry(tmp_path: Path) -> None:
    path = write_recording(tmp_path / "drive")
    config = configured("camera.driver=recording", f"camera.recording={path}", "imu.driver=recording")
    clock = VirtualClock()
    camera, imu, speed = (each(config, clock) for each in (open_camera, open_imu, open_speed))
    assert imu is not None
    assert speed is not None
    records = camera.read()[0], imu.read()[0], speed.read()[0]
    assert tuple(map(type, records)) == (Frame, ImuSample, SpeedSample)
    assert len({record.stamp_ns for record in records}) == 1
    for device in (camera, imu, speed):
        device.close()


@pytest.mark.parametrize(
    ("driver", "only_libcamera_can", "through_libcamera"),
    [("libcamera", False, True), ("auto", True, True), ("auto", False, False), ("v4l2", True, False)],
)
def test_a_camera_that_only_libcamera_can_run_is_run_by_it(
    monkeypatch: pytest.MonkeyPatch, driver: str, only_libcamera_can: bool, through_libcamera: bool
) -> None:
    monkeypatch.setattr(find, "is_libcameras", lambda _: only_libcamera_can)
    monkeypatch.setattr(libcamera, "COMMAND", command(World()))
    config = configured(f"camera.driver={driver}", "camera.device=imx219", "camera.width=64", "camera.height=48")
    if through_libcamera:
        with closing(open_camera(config)) as camera:
            while not (frames := camera.read()):
                pass
        assert frames[0].image.shape == (48, 64)
    else:
        with pytest.raises(DeviceMissingError, match=r"^imx219: no camera has this name"):
            open_camera(config)


def test_every_format_that_can_be_read_can_be_configured() -> None:
    assert set(get_args(PixelFormat)) == {"auto", *PIXEL_FORMATS}


def test_the_imu_may_have_a_recording_of_its_own(tmp_path: Path) -> None:
    silent, whole = write_recording(tmp_path / "silent", imu=False), write_recording(tmp_path / "whole")
    clock = VirtualClock()
    config = configured(
        "camera.driver=recording", f"camera.recording={silent}", "imu.driver=recording", f"imu.recording={whole}"
    )
    imu = open_imu(config, clock)
    assert imu is not None
    assert imu.read()
    imu.close()
    assert open_speed(config, clock) is None


def test_without_a_stand_in_there_is_no_odometry_here_and_without_a_driver_no_imu() -> None:
    assert open_speed(configured()) is None
    assert open_imu(configured()) is None


def test_the_cameras_keys_reach_its_driver() -> None:
    with pytest.raises(DeviceMissingError, match=r"/dev/v4l/by-id/no-such-camera: no such camera"):
        open_camera(configured("camera.device=/dev/v4l/by-id/no-such-camera"))


@pytest.mark.parametrize("driver", names("i2c"))
def test_chips_are_looked_for_on_their_bus(driver: str) -> None:
    with pytest.raises(DriverError, match=r"i2c-255"):
        open_imu(configured(f"imu.driver={driver}", "imu.bus=255"))


@pytest.mark.parametrize("driver", names("serial"))
def test_serial_imus_are_looked_for_at_their_port(driver: str) -> None:
    with pytest.raises(DeviceMissingError, match="no-such-port"):
        open_imu(configured(f"imu.driver={driver}", "imu.port=/dev/no-such-port"))


def test_the_kernels_own_driver_is_looked_for_by_name() -> None:
    with pytest.raises(DriverError, match="no-such-chip"):
        open_imu(configured("imu.driver=iio", "imu.device=no-such-chip"))


def test_the_configuration_knows_the_drivers_of_the_registry() -> None:
    assert get_args(ImuDriver) == ("none", *DRIVERS, "recording")


@pytest.mark.parametrize("driver", DRIVERS)
def test_every_driver_of_the_registry_is_there(driver: str) -> None:
    DRIVERS[driver].load()


def test_only_what_is_used_is_loaded() -> None:
    code = (
        "import sys; from lcf_edge import devices; from lcf_edge.config import Config; devices.open_imu(Config());"
        "print([name for name in sys.modules if name.startswith(('hil_mocks.', 'drivers.imu.', 'drivers.camera.'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "['drivers.imu.registry']"
