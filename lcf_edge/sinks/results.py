"""Result lines: one JSON object a frame."""

import sys
from pathlib import Path
from typing import Any, BinaryIO, Self

import msgspec
import numpy as np

from lcf_edge.records import Cause, Kind, Scene, Shape
from lcf_edge.sinks import cannot_write

_KINDS = {int(kind): kind.name.lower() for kind in Kind}
_CAUSES = {int(cause): cause.name.lower() for cause in Cause}
_FIELDS = {"radius": "r", "ttc": "ttc_s", "range": "range_m", "lateral": "lateral_m"}
"""Fields of ``CIRCLE`` whose name in a line differs."""


def encode_line(scene: Scene) -> bytes:
    """One frame as a JSON object and a newline; 3 decimals, unknown numbers (NaN, infinite) are null."""
    line = {
        "stamp_ns": scene.stamp_ns,
        "seq": scene.seq,
        "circles": _circles(scene),
        "psi": _psi(scene),
        "sizes": scene.sizes,
        "timing_us": scene.timing,
        "speed": round(float(scene.vehicle_speed), 3),
        "notes": scene.notes,
    }
    return msgspec.json.encode(line) + b"\n"


def _columns(table: np.ndarray[Any, np.dtype[np.void]]) -> dict[str, list[Any]]:
    """Each field of a table as a list of Python numbers, floats with 3 decimals."""
    names = table.dtype.names or ()
    return {
        name: (np.round(table[name].astype(np.float64), 3) if table[name].dtype.kind == "f" else table[name]).tolist()
        for name in names
    }


def _circles(scene: Scene) -> list[dict[str, Any]]:
    columns = _columns(scene.circles)
    columns["kind"] = [_KINDS[kind] for kind in columns["kind"]]
    columns["cause"] = [_CAUSES[cause] for cause in columns["cause"]]
    names = [_FIELDS.get(name, name) for name in columns]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _psi(scene: Scene) -> list[dict[str, Any]]:
    columns = _columns(scene.psi)
    return [
        {"id": id_, "shape": "circle", "x": x, "y": y, "r": round(width / 2, 3)}
        if shape == Shape.CIRCLE
        else {"id": id_, "shape": "rect", "x": x, "y": y, "w": width, "h": height}
        for id_, shape, x, y, width, height, _ in zip(*columns.values(), strict=True)
    ]


class ResultsSink:
    """A file of result lines, each handed over whole. ``-`` is standard output.

    Raises ``SinkError`` when the file cannot be opened or written.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            self._file: BinaryIO = sys.stdout.buffer if path == "-" else Path(path).open("wb")  # noqa: SIM115
        except OSError as error:
            raise cannot_write(path, error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, failed: type[BaseException] | None, *_: object) -> None:
        try:
            if self.path != "-":
                self._file.close()
        except OSError as error:
            if failed is None:  # else `write` has told
                raise cannot_write(self.path, error) from error

    def write(self, scene: Scene) -> None:
        """Append one frame."""
        try:
            self._file.write(encode_line(scene))
            self._file.flush()
        except BrokenPipeError:
            raise  # the reader has seen enough
        except OSError as error:
            raise cannot_write(self.path, error) from error
