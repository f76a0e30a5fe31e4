"""Temperature and throttling of the board, as far as the kernel reports them."""

from dataclasses import dataclass
from pathlib import Path

_PI_THROTTLED = {  # bits of the Raspberry Pi firmware's get_throttled that describe the present
    0x1: "under-voltage",
    0x2: "frequency capped",
    0x4: "throttled",
    0x8: "soft temperature limit",
}
_CPU_COOLING = ("cpufreq", "processor", "cpu")  # names of cooling devices that slow the processor


@dataclass(frozen=True, slots=True)
class Board:
    """``temperature_c``: of the hottest zone, None: unknown. ``slowed``: what holds the processor back."""

    temperature_c: float | None
    slowed: tuple[str, ...]


def read_board(sys: Path = Path("/sys")) -> Board:
    """Read ``sys``; what cannot be read is left out."""
    zones = (_number(zone / "temp") for zone in _found(sys, "class/thermal/thermal_zone*"))
    temperatures_c = [millidegrees / 1000 for millidegrees in zones if millidegrees is not None]
    slowed = [
        _text(device / "type")
        for device in _found(sys, "class/thermal/cooling_device*")
        if _text(device / "type").lower().startswith(_CPU_COOLING) and (_number(device / "cur_state") or 0) > 0
    ]
    throttled = _number(sys / "devices/platform/soc/soc:firmware/get_throttled", base=16) or 0
    slowed += [name for bit, name in _PI_THROTTLED.items() if throttled & bit]
    return Board(max(temperatures_c, default=None), tuple(slowed))


def _found(sys: Path, pattern: str) -> list[Path]:
    try:
        return sorted(sys.glob(pattern))
    except OSError:  # no descriptor is left
        return []


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="ascii", errors="replace").strip()
    except OSError:  # for example, a zone that is switched off
        return ""


def _number(file: Path, base: int = 10) -> int | None:
    try:
        return int(_text(file), base)
    except ValueError:
        return None
