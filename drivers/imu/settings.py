"""Requested settings of an IMU; the driver takes the closest rate that its chip offers."""

from dataclasses import dataclass
from pathlib import Path

FIRMWARE = Path("/lib/firmware/bmi270-init-data.fw")


@dataclass(frozen=True, slots=True)
class ImuSettings:
    """Rate and ranges, and settings that only some chips need."""

    rate_hz: float = 200.0
    gyro_range_dps: int = 500
    accel_range_g: int = 4
    identity: int | None = None  # of a copy to accept as the chip
    firmware: Path = FIRMWARE  # the vendor's file, for a chip that needs one


DEFAULT_SETTINGS = ImuSettings()
