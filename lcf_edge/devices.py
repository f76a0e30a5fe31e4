"""Which driver or stand-in the configuration means, and how it is opened.

Modules are imported where they are needed: a vehicle with one chip does not load the drivers of the others.
"""
# ruff: noqa: PLC0415

from pathlib import Path
from typing import Any

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.device import Device
from drivers.errors import WrongDeviceError
from drivers.imu.registry import DRIVERS
from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config


def open_camera(config: Config, clock: Clock = SYSTEM_CLOCK) -> Device[Frame]:
    """The camera, open. Raises ``DriverError``."""
    camera = config.camera
    if camera.driver == "recording":
        from lcf_edge.recording.playback import RecordedCamera

        return RecordedCamera(Path(camera.recording), config, clock)
    from drivers.camera.find import is_libcameras

    settings: dict[str, Any] = {
        "width": camera.width,
        "height": camera.height,
        "fps": camera.fps,
        "pixel_format": camera.format,
        "exposure_s": camera.exposure_s,
        "gain": camera.gain,
        "power_line_hz": camera.power_line_hz,
        "clock": clock,
    }
    if camera.driver == "libcamera" or (camera.driver == "auto" and is_libcameras(camera.device)):
        from drivers.camera.libcamera import LibcameraCamera

        return LibcameraCamera(camera.device, **settings)
    from drivers.camera.v4l2 import V4l2Camera

    return V4l2Camera(camera.device, **settings)


def open_imu(config: Config, clock: Clock = SYSTEM_CLOCK) -> Device[ImuSample] | None:
    """The IMU, open; None where there is none. Raises ``DriverError``."""
    imu = config.imu
    if imu.driver == "none":
        return None
    if imu.driver == "recording":
        from lcf_edge.recording.playback import RecordedImu

        return RecordedImu(Path(imu.recording or config.camera.recording), config, clock)
    from drivers.imu.settings import ImuSettings

    settings = ImuSettings(imu.rate_hz, imu.gyro_range_dps, imu.accel_range_g, imu.identity, Path(imu.firmware))
    match DRIVERS[imu.driver].interface:
        case "iio":
            from drivers.imu.iio import Iio

            return Iio(imu.device, settings, clock=clock)
        case "serial":
            from drivers.imu.serial_imu import open_port

            return open_port(imu.driver, imu.port, imu.baud, settings, clock)
        case "i2c":
            from drivers.imu.i2c_chips import open_chip

            return open_chip(imu.driver, imu.bus, imu.address, settings, clock)


def open_speed(config: Config, clock: Clock = SYSTEM_CLOCK) -> Device[SpeedSample] | None:
    """The odometry of the recording that stands in for the camera; None with a real one or without odometry.

    A real vehicle's odometry comes over Zenoh. Raises ``DriverError``.
    """
    if config.camera.driver != "recording":
        return None
    from lcf_edge.recording.playback import RecordedSpeed

    try:
        return RecordedSpeed(Path(config.camera.recording), config, clock)
    except WrongDeviceError:
        return None
