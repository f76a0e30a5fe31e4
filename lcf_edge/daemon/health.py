"""The state of each part of the daemon, for the diagnostics and for systemd's status line."""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec

from lcf_edge.compilation import uncompiled
from lcf_edge.config import Config
from lcf_edge.daemon.board import read_board
from lcf_edge.daemon.clock import SystemTime
from lcf_edge.daemon.descriptors import Reserve
from lcf_edge.daemon.link import Link
from lcf_edge.daemon.loop import Loop, Mail
from lcf_edge.daemon.memory import MemoryWatch
from lcf_edge.daemon.reader import Reader
from lcf_edge.dates import utc
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import Kind

LATENCY_TURN_S = 30.0
_SILENT_S = 1.0  # or so many intervals:
_SILENT_INTERVALS = 10


class Health:
    """Reads the state of all parts; changes nothing but the window of the latency."""

    def __init__(
        self,
        readers: Sequence[Reader[Any]],
        mail: Mail,
        loop: Loop,
        link: Link,
        system_time: SystemTime,
        reserve: Reserve,
        sys: Path = Path("/sys"),
    ) -> None:
        self._readers = readers
        self._mail = mail
        self._loop = loop
        self._link = link
        self._system_time = system_time
        self._reserve = reserve
        self._sys = sys
        self._turned_s = time.monotonic()

    def statuses(self, config: Config, memory: MemoryWatch) -> list[DeviceStatus]:
        """Return a status for each part."""
        if time.monotonic() - self._turned_s > LATENCY_TURN_S:
            self._turned_s = time.monotonic()
            for durations in (self._loop.latency, self._loop.detect, self._loop.filter):
                durations.turn()
        devices = [self._device(reader) for reader in self._readers]
        return [*devices, self._pipeline(config), _memory(memory), self._board(), self._published()]

    def line(self, memory: MemoryWatch) -> str:
        """Return one line: rate, objects, circles, memory, and the camera's error if it has one."""
        camera = self._readers[0]
        scene = self._loop.scene
        rate_hz = camera.intervals.rate_hz
        what = f"{0 if math.isnan(rate_hz) else rate_hz:.1f} frames/s" if camera.away_since_ns is None else "no camera"
        if scene is not None and camera.away_since_ns is None:
            rebels = int((scene.circles["kind"] == Kind.REBEL).sum())
            what += f", {len(scene.objects)} objects, {len(scene.circles)} circles ({rebels} rebel)"
        what += f", {memory.resident_mib:.0f} MiB"
        return f"{what}; {camera.error}" if camera.error else what

    def _device(self, reader: Reader[Any]) -> DeviceStatus:
        now_ns = time.monotonic_ns()
        last_ns, meter = reader.intervals.last_ns, reader.intervals
        age_s = math.inf if last_ns is None else (now_ns - last_ns) / 1e9
        values = {
            "rate_hz": f"{meter.rate_hz:.2f}",
            "jitter_ms": f"{1e3 * meter.jitter_s:.3f}",
            "age_s": f"{age_s:.3f}",
        }
        counts = {**reader.counts, "overtaken before the pipeline": self._overtaken(reader.name)}
        values |= {name: str(count) for name, count in sorted(counts.items())}
        level, message = Level.OK, "delivers"
        if reader.away_since_ns is not None:
            since = self._iso(reader.away_since_ns)
            level = Level.ERROR if reader.name == "camera" else Level.WARN
            message = f"away since {since}: {reader.error}" if reader.error else f"being opened since {since}"
        elif age_s > max(_SILENT_S, _SILENT_INTERVALS / meter.rate_hz if meter.rate_hz > 0 else 0):
            level, message = Level.STALE, f"silent since {self._iso(last_ns or now_ns)}"
        return DeviceStatus(reader.name, level, message, values)

    def _overtaken(self, name: str) -> int:
        mail = self._mail
        return {"camera": mail.frames.overtaken, "imu": mail.imu.overtaken, "speed": mail.speeds.overtaken}[name]

    def _iso(self, monotonic_ns: int) -> str:
        return f"{utc(self._system_time.system_ns(monotonic_ns)):%Y-%m-%dT%H:%M:%SZ}"

    def _pipeline(self, config: Config) -> DeviceStatus:
        loop = self._loop
        notes = loop.degradation.notes if self._readers[0].away_since_ns is None else ()
        values = {
            "filter": "uncompiled" if uncompiled() else "compiled",
            "latency_p50_ms": f"{1e3 * loop.latency.percentile_s(50):.2f}",
            "latency_p99_ms": f"{1e3 * loop.latency.percentile_s(99):.2f}",
            "detect_p50_ms": f"{1e3 * loop.detect.percentile_s(50):.2f}",
            "filter_p50_ms": f"{1e3 * loop.filter.percentile_s(50):.2f}",
            "scenes": str(loop.frames),
            "evicted": str(loop.evicted),
            "clock_steps": str(self._system_time.steps),
        }
        if loop.scene is not None:
            capacities = msgspec.structs.asdict(config.memory)
            for table, rows in asdict(loop.scene.sizes).items():
                if table in capacities:
                    values[f"{table}_fill"] = f"{rows}/{capacities[table]}"
        if config.imu.driver != "none" and loop.gyro_bias is not None:
            values["gyro_bias_radps"] = " ".join(f"{bias:+.4f}" for bias in loop.gyro_bias.mean_radps)
            values["gyro_bias_sigma_radps"] = f"{loop.gyro_bias.sigma_radps.max():.4f}"
        if loop.mounting is not None:
            values |= {f"camera_{name}": f"{value:.4f}" for name, value in asdict(loop.mounting).items()}
        if loop.shutter is not None and loop.shutter.is_known:
            values["camera_readout_ms"] = f"{1e3 * loop.shutter.readout_s:.1f}"
            values["camera_readout_sigma_ms"] = f"{1e3 * loop.shutter.sigma_s:.1f}"
        values |= {f"refused {reason}": str(count) for reason, count in sorted(loop.refused.items())}
        return DeviceStatus("pipeline", Level.WARN if notes else Level.OK, "; ".join(notes) or "runs", values)

    def _board(self) -> DeviceStatus:
        board = read_board(self._sys)
        values = {} if board.temperature_c is None else {"temperature_c": f"{board.temperature_c:.1f}"}
        if board.slowed:
            return DeviceStatus("board", Level.WARN, f"slowed down: {', '.join(board.slowed)}; cool it", values)
        return DeviceStatus("board", Level.OK, "runs at full speed", values)

    def _published(self) -> DeviceStatus:
        counts: Mapping[str, int] = {**self._link.counts, "descriptor shortages": self._reserve.shortages}
        sessions = self._link.sessions
        values = {"sessions": str(sessions)} | {name: str(count) for name, count in sorted(counts.items())}
        if sessions >= self._link.max_sessions:
            return DeviceStatus("link", Level.WARN, f"{sessions} sessions: no more are let in", values)
        if self._reserve.short:
            return DeviceStatus("link", Level.WARN, "connections use up all file descriptors", values)
        return DeviceStatus("link", Level.OK, "open", values)


def _memory(memory: MemoryWatch) -> DeviceStatus:
    values = {"resident_mib": f"{memory.resident_mib:.1f}", "budget_mib": f"{memory.budget_mib:g}"}
    if memory.shed:
        return DeviceStatus("memory", Level.WARN, f"gave up {', '.join(memory.shed)}", values)
    return DeviceStatus("memory", Level.OK, "within the budget", values)
