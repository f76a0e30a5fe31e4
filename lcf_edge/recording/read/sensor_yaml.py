"""``sensor.yaml`` of the EuRoC/ASL layout: a few keys with numbers, some nested once.

YAML libraries fail on its dialects (``%YAML:1.0``, ``!!opencv-matrix``, lists over several lines), so the few
forms that occur are read line by line.
"""

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lcf_edge.errors import ConfigError, RecordingError
from lcf_edge.lens import Lens
from lcf_edge.recording.read.distortion import distortion

Rotation = npt.NDArray[np.float64]
"""(3, 3)"""

MAX_BYTES = 65536


class SensorYaml:
    """The entries of one file. Raises ``RecordingError`` that names the file and the key."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._entries: dict[str, str] = {}
        try:
            if path.stat().st_size > MAX_BYTES:
                raise RecordingError(f"{path}: too large for a sensor.yaml; fix or remove it")
            self._parse(path.read_text(encoding="utf-8-sig"))
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read ({error.strerror}); fix or remove it") from error
        except UnicodeDecodeError as error:
            raise RecordingError(f"{path}: not a text file; fix or remove it") from error

    def lens(self) -> Lens:
        """Lens of a pinhole camera: ``resolution``, ``intrinsics``, ``distortion_*``."""
        camera = self._text("camera_model", "pinhole")
        if camera != "pinhole":
            raise self._error("camera_model", f"{camera} is not supported, only pinhole")
        width, height = self._numbers("resolution", 2)
        if min(width, height) < 1 or (width % 1, height % 1) != (0, 0):
            raise self._error("resolution", "width and height must be whole positive numbers")
        fx, fy, cx, cy = self._numbers("intrinsics", 4)
        name = self._text("distortion_model", "none")
        coefficients = () if name in ("", "none") else self._numbers("distortion_coefficients")
        try:
            model, coefficients = distortion(name, coefficients)
        except ValueError as error:
            raise self._error("distortion_model", str(error)) from error
        try:
            return Lens(int(width), int(height), fx, fy, cx, cy, model, coefficients)
        except ConfigError as error:
            raise RecordingError(f"{self._path}: {error}; fix the file") from error

    def rotation(self) -> Rotation:
        """Rotation of ``T_BS``, from the sensor's axes to the body's; the identity when it is not given."""
        key = "T_BS.data" if "T_BS.data" in self._entries else "T_BS"
        if key not in self._entries:
            return np.eye(3)
        rotation = np.reshape(self._numbers(key, 16), (4, 4))[:3, :3]
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0:
            raise self._error(key, "the upper left 3x3 is not a rotation")
        return rotation

    def _parse(self, text: str) -> None:
        """Dotted keys; a value may go on over lines inside brackets or as ``- item`` lines."""
        parent = key = ""
        for number, raw in enumerate(text.splitlines(), 1):
            line = raw.split("#", 1)[0].strip()
            if not line or line.startswith(("%", "---")):
                continue
            value = self._entries.get(key, "")
            name, colon, rest = line.partition(":")
            if value.count("[") > value.count("]"):
                self._entries[key] = f"{value} {line}"
            elif key and line.startswith("-"):
                item = re.sub(r"^(-\s+)+", "", line)
                self._entries[key] = f"{value}, {item}"
            elif colon:
                if not raw[0].isspace():
                    parent, key = name, name
                else:
                    key = f"{parent}.{name}"
                self._entries[key] = re.sub(r"^!!\S+", "", rest.strip())
            else:
                raise RecordingError(f"{self._path}:{number}: expected `key: value`; fix or remove the file")

    def _text(self, key: str, default: str) -> str:
        return self._entries.get(key, default).strip("\"' ").lower()

    def _numbers(self, key: str, count: int | None = None) -> tuple[float, ...]:
        if key not in self._entries:
            raise self._error(key, "missing")
        parts = re.sub(r"[\[\]]", " ", self._entries[key]).replace(",", " ").split()
        try:
            numbers = tuple(map(float, parts))
        except ValueError as error:
            raise self._error(key, "not a list of numbers") from error
        if not np.isfinite(numbers).all() or (count is not None and len(numbers) != count):
            raise self._error(key, f"{count or 'finite'} numbers are needed")
        return numbers

    def _error(self, key: str, what: str) -> RecordingError:
        return RecordingError(f"{self._path}: {key}: {what}; fix or remove the file")
