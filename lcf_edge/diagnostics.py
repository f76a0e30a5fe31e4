"""How each part of the program is, as it is logged and published."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum


class Level(IntEnum):
    """As ``diagnostic_msgs/msg/DiagnosticStatus`` numbers them."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3  # nothing new for too long


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """How one device, or another part of the program, is."""

    name: str  # "camera", "imu", "pipeline", …
    level: Level
    message: str  # one line
    values: Mapping[str, str] = field(default_factory=dict)  # with the unit in each name: {"rate_hz": "29.9"}
