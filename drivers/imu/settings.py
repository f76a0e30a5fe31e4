"""What is requested of an IMU; the driver takes the closest rate that its chip has."""

from dataclasses import dataclass
from pathlib import Path

FIRMWARE = Path("/lib/firmware/bmi270-init-data.fw")


@dataclass(frozen=True, slots=True)
class ImuSettings:
    """Rate and ranges, and what only some chips need."""

    rate_hz: float = 200.0
    gyro_range_dps: int = 500
    accel_range_g: int = 4
    identity: int | None = None  # of a copy that is taken for the chip all the same
    firmware: Path = FIRMWARE  # the vendor's file, for a chip that needs one


DEFAULT_SETTINGS = ImuSettings()
