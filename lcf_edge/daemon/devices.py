"""A reader for each device of the configuration."""

from collections.abc import Callable, Sequence
from typing import Any

from drivers.clock import Clock
from drivers.device import Device
from drivers.errors import WrongDeviceError
from drivers.samples import ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.daemon.clock import StoppableClock
from lcf_edge.daemon.descriptors import Reserve
from lcf_edge.daemon.loop import Mail
from lcf_edge.daemon.reader import Reader
from lcf_edge.devices import open_camera, open_imu, open_speed


def readers(config: Config, mail: Mail, clock: StoppableClock, reserve: Reserve) -> list[Reader[Any]]:
    """Return readers, not started: of the camera, of the IMU if there is one, of a stand-in recording's odometry."""

    def reader(name: str, open_device: Callable[[Config, Clock], Any], put: Callable[[Sequence[Any]], object]) -> Any:
        def opened(at: Clock) -> Any:
            with reserve.lent():
                return open_device(config, at)

        return Reader(name, opened, put, clock)

    sources = [reader("camera", open_camera, lambda frames: mail.frames.put(frames[-1]))]
    if config.imu.driver != "none":
        sources.append(reader("imu", _imu, mail.imu.put))
    if config.camera.driver == "recording" and config.vehicle.speed_source in {"auto", "odometry"}:
        sources.append(reader("speed", _speed, mail.speeds.put))
    return sources


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
