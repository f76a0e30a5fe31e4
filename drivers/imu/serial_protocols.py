"""The serial protocols by the name that ``imu.driver`` gives them."""

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.device import Device
from drivers.imu import bno08x_rvc, csv_line, witmotion, xsens
from drivers.imu.serial_imu import SerialImu
from drivers.imu.settings import ImuSettings
from drivers.records import ImuSample

PROTOCOLS = {module.PROTOCOL.name: module.PROTOCOL for module in (witmotion, bno08x_rvc, xsens, csv_line)}


def open_port(
    driver: str, port: str, baud: int, settings: ImuSettings, clock: Clock = SYSTEM_CLOCK
) -> Device[ImuSample]:
    """Open the IMU at a serial port.

    ``driver``: a key of ``PROTOCOLS``. ``baud``: 0 for the protocol's usual one. ``settings``: only the rate counts, as
    the one to start from; serial IMUs send as they were set up. Raises what ``SerialImu`` raises.
    """
    return SerialImu(PROTOCOLS[driver], port, baud, settings.rate_hz, clock)
