"""What is asked of an IMU; the driver takes the closest rate that its chip has."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ImuSettings:
    """Rate and ranges."""

    rate_hz: float = 200.0
    gyro_range_dps: int = 500
    accel_range_g: int = 4


USUAL = ImuSettings()
