"""Result lines: one JSON object a frame."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import numpy as np

from drivers.samples import Frame
from lcf_edge.messages import Cause, Kind, ObjectClass, ObjectState, PipelineScene, Scene, Shape, View
from lcf_edge.sinks import cannot_write
from lcf_edge.sinks.sink import Sink

_KINDS = {int(kind): kind.name.lower() for kind in Kind}
_CAUSES = {int(cause): cause.name.lower() for cause in Cause}
_CLASSES = {int(kind): kind.name.lower() for kind in ObjectClass}
_STATES = {int(state): state.name.lower() for state in ObjectState}
_UNITS = {"ttc": "s", "range": "m", "lateral": "m", "v_forward": "mps", "v_right": "mps", "closest": "s"}
_FIELDS = {
    "radius": "r",
    "class_id": "class",
    "width": "w",
    "height": "h",
    "age": "age_s",
    "unseen": "unseen_s",
    **{name + sigma: f"{name}{sigma}_{unit}" for name, unit in _UNITS.items() for sigma in ("", "_sigma")},
}
"""Fields of ``CIRCLE`` and ``OBJECT`` whose name in a line differs."""


def encode_line(scene: PipelineScene) -> bytes:
    """One frame as a JSON object and a newline; 3 decimals, unknown numbers (NaN, infinite) are null."""
    sent = sent_fields(scene)
    speed = sent.pop("speed")
    circles = _circles_of_objects(scene)
    for thing in sent["objects"]:
        thing["circles"] = circles.get(thing["id"], [])
    line = {**sent, "sizes": scene.sizes, "timing_us": scene.timing, "speed": speed, "notes": scene.notes}
    return msgspec.json.encode(line) + b"\n"


def sent_fields(scene: Scene) -> dict[str, Any]:
    """Return the part of a line that is also sent over Zenoh; unknown numbers are NaN or infinite."""
    return {
        "stamp_ns": scene.stamp_ns,
        "seq": scene.seq,
        "objects": _objects(scene),
        "circles": _circles(scene),
        "psi": _psi(scene),
        "speed": round(float(scene.vehicle_speed), 3),
    }


def _columns(table: np.ndarray[Any, np.dtype[np.void]]) -> dict[str, list[Any]]:
    """Return each field of a table as a list of Python numbers, floats with 3 decimals."""
    names = table.dtype.names or ()
    return {
        name: (np.round(table[name].astype(np.float64), 3) if table[name].dtype.kind == "f" else table[name]).tolist()
        for name in names
    }


def _rows(columns: dict[str, list[Any]]) -> list[dict[str, Any]]:
    names = [_FIELDS.get(name, name) for name in columns]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _objects(scene: Scene) -> list[dict[str, Any]]:
    columns = _columns(scene.objects)
    columns["class_id"] = [_CLASSES[kind] for kind in columns["class_id"]]
    columns["state"] = [_STATES[state] for state in columns["state"]]
    return _rows(columns)


def _circles_of_objects(scene: PipelineScene) -> dict[int, list[int]]:
    """Return the ids of the circles of each object, as far as known."""
    circles: dict[int, list[int]] = {}
    for circle, owner in zip(scene.circles["id"].tolist(), scene.circle_objects.tolist(), strict=False):
        circles.setdefault(owner, []).append(circle)
    return circles


def _circles(scene: Scene) -> list[dict[str, Any]]:
    columns = _columns(scene.circles)
    columns["kind"] = [_KINDS[kind] for kind in columns["kind"]]
    columns["cause"] = [_CAUSES[cause] for cause in columns["cause"]]
    return _rows(columns)


def _psi(scene: Scene) -> list[dict[str, Any]]:
    columns = _columns(scene.psi)
    return [
        {"id": id_, "shape": "circle", "x": x, "y": y, "r": round(width / 2, 3)}
        if shape == Shape.CIRCLE
        else {"id": id_, "shape": "rect", "x": x, "y": y, "w": width, "h": height}
        for id_, shape, x, y, width, height, _ in zip(*columns.values(), strict=True)
    ]


class ResultsSink(Sink):
    """A file of result lines, each handed over whole. ``-`` is standard output.

    Raises ``SinkError`` when the file cannot be opened or written.
    """

    name = "results"

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            self._file: BinaryIO = sys.stdout.buffer if path == "-" else Path(path).open("wb")  # noqa: SIM115
        except OSError as error:
            raise cannot_write(path, error) from error

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:  # noqa: ARG002
        """Append one frame."""
        try:
            self._file.write(encode_line(scene))
            self._file.flush()
        except BrokenPipeError:
            raise  # the reader has seen enough
        except OSError as error:
            raise cannot_write(self.path, error) from error

    def close(self) -> None:
        """Close the file, but not standard output."""
        try:
            if self.path != "-":
                self._file.close()
        except BrokenPipeError:
            raise
        except OSError as error:
            raise cannot_write(self.path, error) from error
