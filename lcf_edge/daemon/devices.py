"""A reader for each device of the configuration."""

from typing import Any

from drivers.clock import Clock
from drivers.device import Device
from drivers.errors import WrongDeviceError
from drivers.records import ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.daemon.clock import StoppableClock
from lcf_edge.daemon.loop import Mail
from lcf_edge.daemon.reader import Reader
from lcf_edge.devices import open_camera, open_imu, open_speed


def readers(config: Config, mail: Mail, clock: StoppableClock) -> list[Reader[Any]]:
    """Of the camera, which comes first, of the IMU if there is one, of a stand-in recording's odometry; not started."""
    wanted: list[Reader[Any]] = [
        Reader("camera", lambda at: open_camera(config, at), lambda frames: mail.frames.put(frames[-1]), clock)
    ]
    if config.imu.driver != "none":
        wanted.append(Reader("imu", lambda at: _imu(config, at), mail.imu.put, clock))
    if config.camera.driver == "recording" and config.vehicle.speed_source in {"auto", "odometry"}:
        wanted.append(Reader("speed", lambda at: _speed(config, at), mail.speeds.put, clock))
    return wanted


def _imu(config: Config, clock: Clock) -> Device[ImuSample]:
    device = open_imu(config, clock)
    if device is None:
        raise WrongDeviceError("imu.driver: none is configured; name one")
    return device


def _speed(config: Config, clock: Clock) -> Device[SpeedSample]:
    device = open_speed(config, clock)
    if device is None:
        raise WrongDeviceError(f"{config.camera.recording}: no odometry in it; set vehicle.speed_source")
    return device
