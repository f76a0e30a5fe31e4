"""An IMU's folder under ``/sys/bus/iio/devices``: finding it, its attributes, its channels, the layout of its scans."""

import errno
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    DriverError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from drivers.samples import STANDARD_GRAVITY_MPS2

GYRO = tuple(f"in_anglvel_{axis}" for axis in "xyz")
ACCEL = tuple(f"in_accel_{axis}" for axis in "xyz")
STAMP = "in_timestamp"
GYRO_SUFFIX = re.compile("[-_]gyro$")  # st_lsm6dsx; inv_icm42600 and inv_icm45600 have a hyphen

SCAN_TYPE = re.compile(  # of Documentation/driver-api/iio/buffers.rst, in which repeat and shift may be left out
    r"(?P<order>[bl])e:(?P<sign>[su])(?P<bits>\d+)/(?P<storage>8|16|32|64)(?:X1)?(?:>>(?P<shift>\d+))?"
)


@dataclass(frozen=True, slots=True)
class Channel:
    """Scale of an axis to SI units: (counts + offset) * scale."""

    scale: float
    offset: float
    end: int  # largest count


def find(device: str, root: Path) -> tuple[Path, Path]:
    """Folders of the gyro and of the accelerometer."""
    folders = sorted(root.glob("iio:device*"))
    names = {folder: text_of(folder / "name") for folder in folders}
    gyros = [folder for folder in folders if (folder / "in_anglvel_x_raw").exists()]
    for gyro in gyros:
        chip = GYRO_SUFFIX.sub("", names[gyro])
        if device in ("", gyro.name, names[gyro], chip):
            others = (f"{chip}_accel", f"{chip}-accel")
            for accel in (gyro, *(folder for folder in folders if names[folder] in others)):
                if (accel / "in_accel_x_raw").exists():
                    return gyro, accel
            raise WrongDeviceError(f"{names[gyro]} ({gyro.name}): has no accelerometer; set imu.device to another")
    there = ", ".join(f"{names[gyro]} ({gyro.name})" for gyro in gyros)
    remedy = f"there is {there}; set imu.device" if there else "there is no gyro at all; is the kernel's driver loaded?"
    raise DeviceMissingError(f"{device or 'iio'}: no such device under {root}; {remedy}")


def set_rate(gyro: Path, accel: Path, rate_hz: float) -> float:
    """Set the closest rate on offer and return the resulting one; sensors may share it."""
    written = []
    for folder, own in ((gyro, "in_anglvel_sampling_frequency"), (accel, "in_accel_sampling_frequency")):
        name = own if (folder / own).exists() else "sampling_frequency"
        if (folder / name).exists():
            _choose(folder / name, folder / f"{name}_available", rate_hz)
            written.append(number_of(folder / name))
    granted_hz = min(written, default=rate_hz)
    if not granted_hz > 0:
        raise UnsupportedSettingError(f"{gyro.name}: says that its rate is {granted_hz:g} Hz; set imu.rate_hz")
    return granted_hz


def set_ranges(gyro: Path, accel: Path, gyro_range_dps: float, accel_range_g: float) -> None:
    """Set the ranges closest to these, where there is a choice."""
    _set_range(gyro, "in_anglvel", math.radians(gyro_range_dps))
    _set_range(accel, "in_accel", accel_range_g * STANDARD_GRAVITY_MPS2)


def _set_range(folder: Path, kind: str, full_scale: float) -> None:
    """Set the scale at which the largest count is closest to ``full_scale`` (SI), where there is a choice."""
    available = folder / f"{kind}_scale_available"
    if available.exists():
        end = channel(folder, f"{kind}_x").end
        _choose(folder / f"{kind}_scale", available, full_scale / end)


def _choose(attribute: Path, available: Path, target: float) -> None:
    """Write the closest value on offer, spelled as offered; nothing if it is already set."""
    text = text_of(available)
    try:
        if text.startswith("["):
            low, _, high = map(float, text.strip("[]").split())
            choice = f"{min(max(target, low), high):g}"
        else:
            choice = min(text.split(), key=lambda offered: abs(float(offered) - target), default=f"{target:g}")
    except ValueError as error:
        raise WrongDeviceError(f"{available}: not a list of numbers; is this an IMU?") from error
    if float(choice) != number_of(attribute):
        write_to(attribute, choice)


def channel(folder: Path, name: str) -> Channel:
    """Return the scale of a channel."""
    kind = name.rpartition("_")[0]

    def first(suffix: str, otherwise: float) -> float:
        for attribute in (folder / f"{name}_{suffix}", folder / f"{kind}_{suffix}"):
            if attribute.exists():
                return number_of(attribute)
        return otherwise

    layout = SCAN_TYPE.fullmatch(text_of(folder / f"scan_elements/{name}_type"))
    bits = int(layout["bits"]) if layout else 16
    return Channel(first("scale", 1.0), first("offset", 0.0), 2 ** (bits - 1) - 1)


@dataclass(frozen=True, slots=True)
class Scan:
    """The layout of one scan."""

    type: np.dtype[np.void]
    shifts: dict[str, tuple[int, int]]  # left, then right: extracts the significant bits, sign-extended

    def column(self, scans: npt.NDArray[np.void], name: str) -> list[int]:
        """Return the counts of a channel."""
        left, right = self.shifts[name]
        counts: list[int] = (scans[name] << left >> right).tolist()
        return counts


def scan_of(folder: Path, names: Iterable[str]) -> Scan:
    """Elements by index, each aligned to its size, the whole to the largest. Raises ``UnsupportedSettingError``."""
    elements = []
    for name in names:
        text = text_of(folder / f"scan_elements/{name}_type")
        layout = SCAN_TYPE.fullmatch(text)
        bits, storage, shift = (int(layout[key] or 0) for key in ("bits", "storage", "shift")) if layout else (0, 0, 0)
        if layout is None or not 0 < bits <= storage - shift:
            raise UnsupportedSettingError(f"{folder.name}: {name} has the unknown type {text}; use another driver")
        code = {"b": ">", "l": "<"}[layout["order"]] + {"s": "i", "u": "u"}[layout["sign"]]
        index = number_of(folder / f"scan_elements/{name}_index")
        elements.append((index, name, np.dtype(f"{code}{storage // 8}"), (storage - bits - shift, storage - bits)))
    elements.sort(key=lambda element: element[0])
    at, offsets = 0, []
    for _, _, kind, _ in elements:
        at += -at % kind.itemsize
        offsets.append(at)
        at += kind.itemsize
    type_ = np.dtype(
        {
            "names": [name for _, name, _, _ in elements],
            "formats": [kind for _, _, kind, _ in elements],
            "offsets": offsets,
            "itemsize": at + -at % max(kind.itemsize for _, _, kind, _ in elements),
        }
    )
    return Scan(type_, {name: shifts for _, name, _, shifts in elements})


def has(folder: Path, name: str) -> bool:
    """Whether a channel can be in a scan."""
    return (folder / f"scan_elements/{name}_type").exists()


def has_buffer(folder: Path) -> bool:
    """Whether scans of gyro and accelerometer are available."""
    return (folder / "buffer/enable").exists() and all(has(folder, name) for name in (*GYRO, *ACCEL))


def has_trigger(folder: Path, root: Path) -> bool:
    """Whether scans are triggered; without a trigger, one of the device's own is set."""
    current = folder / "trigger/current_trigger"
    if not current.exists() or text_of(current):
        return True  # a hardware FIFO needs none
    own = text_of(folder / "name")
    for trigger in sorted(root.glob("trigger*")):
        if own and text_of(trigger / "name").startswith(own):
            write_to(current, text_of(trigger / "name"))
            return True
    return False


def text_of(attribute: Path) -> str:
    """Read an attribute as text; empty if it is missing or cannot be read now."""
    try:
        return attribute.read_text(errors="replace").strip()
    except OSError:
        return ""


def number_of(attribute: Path) -> float:
    """Read an attribute as a number. Raises ``DriverError``."""
    try:
        return float(attribute.read_text(errors="replace"))
    except OSError as error:
        raise driver_error(error, attribute) from error
    except ValueError as error:
        raise WrongDeviceError(f"{attribute}: not a number; is this an IMU?") from error


def write_to(attribute: Path, text: str) -> None:
    """Set an attribute. Raises ``DriverError``."""
    try:
        attribute.write_text(text)
    except OSError as error:
        if error.errno == errno.EINVAL:
            raise UnsupportedSettingError(f"{attribute}: {text} is refused; set another") from error
        raise driver_error(error, attribute) from error


def driver_error(error: OSError, path: Path) -> DriverError:
    """Return the typed error for the kernel's."""
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeviceForbiddenError(
            f"{path}: no permission; install the udev rule that gives IIO to the daemon's group"
        )
    if error.errno == errno.EBUSY:
        return DeviceBusyError(f"{path}: in use; stop the other program (iiod?)")
    return DeviceLostError(f"{path}: {error.strerror}; is the chip there?")
