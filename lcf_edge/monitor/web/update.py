"""Updates for the page: the current state as JSON, followed by an image when there is a new one."""

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import msgspec

from lcf_edge.messages import Scene
from lcf_edge.monitor.live.history import LENGTH_S
from lcf_edge.monitor.live.lines import scene_fields
from lcf_edge.monitor.live.monitor import Monitor, Snapshot

if TYPE_CHECKING:
    from lcf_edge.monitor.replay.player import Player


@dataclass(slots=True)
class Audience:
    """What one browser has already received."""

    sent_version: int = -1
    diagnostics_ns: int = -1
    preview_ns: int = -1
    point_ns: int = -1

    def update(self, monitor: "Monitor | Player", endpoint: str) -> list[str | bytes]:
        """Return what is new for it: a text, and perhaps the JPEG that belongs to it."""
        snapshot, now_ns = monitor.snapshot(), time.time_ns()
        self.sent_version = snapshot.version
        update: dict[str, Any] = {
            "connection": {
                "presence": snapshot.presence.value,
                "for_s": _finite((now_ns - snapshot.since_ns) / 1e9),
                "endpoint": endpoint,
                "robots": snapshot.robots,
                "broken": snapshot.broken,
            },
            "scene": _scene(snapshot, now_ns),
            "history_s": LENGTH_S,
            "replay": snapshot.replay,
            "ahead": snapshot.ahead,
        }
        if snapshot.diagnostics is not None:
            update["diagnostics_age_s"] = (now_ns - snapshot.diagnostics_received_ns) / 1e9
        if snapshot.diagnostics is not None and snapshot.diagnostics_received_ns != self.diagnostics_ns:
            self.diagnostics_ns = snapshot.diagnostics_received_ns
            update["status"] = [
                {
                    "name": status.name,
                    "level": status.level.name.lower(),
                    "message": status.message,
                    "values": status.values,
                }
                for status in snapshot.diagnostics.status
            ]
        if points := monitor.traces.since(self.point_ns):
            self.point_ns = points[-1].at_ns
            update["points"] = points
        preview = snapshot.preview
        if preview is None or preview.received_ns == self.preview_ns:
            return [_text(update)]
        self.preview_ns = preview.received_ns
        update["picture"] = {"stamp_ns": preview.image.header.stamp_ns, "scene": _fields(preview.scene)}
        return [_text(update), bytes(preview.image.data)]


def _scene(snapshot: Snapshot, now_ns: int) -> dict[str, Any] | None:
    fields = _fields(snapshot.scene)
    return fields and {
        **fields,
        "age_s": snapshot.scene_age_s(now_ns),
        "rate_hz": _finite(snapshot.rate_hz),
        "latency_ms": _finite(1e3 * snapshot.latency_s),
    }


def _fields(scene: Scene | None) -> dict[str, Any] | None:
    return None if scene is None else scene_fields(scene)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _text(update: dict[str, Any]) -> str:
    return msgspec.json.encode(update).decode()
