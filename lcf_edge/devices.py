"""Which driver or stand-in the configuration means, and how it is opened.

Modules are imported where they are needed: a vehicle with one chip does not load the drivers of the others.
"""
# ruff: noqa: PLC0415

from pathlib import Path

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.device import Device
from drivers.errors import WrongDeviceError
from drivers.records import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config

SERIAL = frozenset({"witmotion", "bno08x_rvc", "xsens", "csv"})
"""Values of ``imu.driver`` that mean a serial port; the others, but ``none``, ``iio`` and ``recording``, mean I2C."""


def open_camera(config: Config, clock: Clock = SYSTEM_CLOCK) -> Device[Frame]:
    """The camera, open. Raises ``DriverError``."""
    camera = config.camera
    if camera.driver == "recording":
        from hil_mocks.playback import RecordedCamera

        return RecordedCamera(Path(camera.recording), config, clock)
    from drivers.camera.v4l2 import V4l2Camera

    return V4l2Camera(
        camera.device,
        width=camera.width,
        height=camera.height,
        fps=camera.fps,
        pixel_format=camera.format,
        exposure_s=camera.exposure_s,
        gain=camera.gain,
        power_line_hz=camera.power_line_hz,
        clock=clock,
    )


def open_imu(config: Config, clock: Clock = SYSTEM_CLOCK) -> Device[ImuSample] | None:
    """The IMU, open; None where there is none. Raises ``DriverError``."""
    imu = config.imu
    if imu.driver == "none":
        return None
    if imu.driver == "recording":
        from hil_mocks.playback import RecordedImu

        return RecordedImu(Path(imu.recording or config.camera.recording), config, clock)
    from drivers.imu.settings import ImuSettings

    settings = ImuSettings(imu.rate_hz, imu.gyro_range_dps, imu.accel_range_g)
    if imu.driver == "iio":
        from drivers.imu.iio import Iio

        return Iio(imu.device, settings, clock=clock)
    if imu.driver in SERIAL:
        from drivers.imu.serial_protocols import open_port

        return open_port(imu.driver, imu.port, imu.baud, settings, clock)
    from drivers.imu.i2c_chips import open_chip

    return open_chip(imu.driver, imu.bus, imu.address, settings, Path(imu.firmware), clock)


def open_speed(config: Config, clock: Clock = SYSTEM_CLOCK) -> Device[SpeedSample] | None:
    """The odometry of the recording that stands in for the camera; None with a real one or without odometry.

    A real vehicle's odometry comes over Zenoh. Raises ``DriverError``.
    """
    if config.camera.driver != "recording":
        return None
    from hil_mocks.playback import RecordedSpeed

    try:
        return RecordedSpeed(Path(config.camera.recording), config, clock)
    except WrongDeviceError:
        return None
