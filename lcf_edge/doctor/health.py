"""What a running daemon reports of itself and its devices."""

from collections.abc import Iterator
from pathlib import Path

from lcf_edge.config.endpoint import bare
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.doctor.finding import Context, Finding, fail, ok, warn
from lcf_edge.doctor.processes import Process, daemon_with, processes

_DEVICES = ("camera", "imu")  # reported by their own checks
_SHOWN = (
    "rate_hz",
    "jitter_ms",
    "latency_p50_ms",
    "latency_p99_ms",
    "gyro_bias_radps",
    "gyro_bias_sigma_radps",
    "camera_readout_ms",
    "camera_readout_sigma_ms",
    "resident_mib",
    "budget_mib",
    "temperature_c",
)
_JOURNAL = "journalctl -u lcf-edge -n 30 --no-pager"


def check(context: Context) -> Iterator[Finding]:
    """Check the daemon and its parts, without the devices."""
    daemon = context.daemon
    running = next((process for process in processes(context.proc) if process.is_daemon), None)
    if daemon is not None and daemon.scene:
        yield warn("daemon", f"answers at {daemon.endpoint}, but has no scenes ({daemon.scene})", _JOURNAL)
    elif daemon is not None:
        yield ok("daemon", f"answers at {daemon.endpoint}, has scenes")
    elif running is not None:
        places = ", ".join(map(bare, context.config.zenoh.listen))
        yield warn(
            "daemon",
            f"{running} does not answer at {places}: another configuration than this?",
            f"tr '\\0' ' ' < /proc/{running.pid}/cmdline",
        )
    else:
        yield ok("daemon", "not running")
    for status in daemon.statuses.values() if daemon else ():
        if status.name not in _DEVICES:
            yield _of_status("daemon", status.name, status)


def daemon_having(context: Context, name: str, path: Path) -> Process | None:
    """Return the daemon that has, or may have, a device open, as far as it reports that and this user may know."""
    process = daemon_with(path.resolve(), context.proc)
    if process is not None and process.files is None and context.daemon and name not in context.daemon.statuses:
        return None  # it uses no such device
    return process


def of_device(context: Context, name: str, daemon: Process) -> Finding:
    """Return findings about a device that the daemon has open."""
    status = context.daemon.statuses.get(name) if context.daemon else None
    if status is not None:
        return _of_status(name, "in use by the daemon", status)
    text = f"not opened: {daemon} may be using it and does not say"
    return warn(name, text, "sudo systemctl stop lcf-edge  # then look again")


def _of_status(subject: str, whose: str, status: DeviceStatus) -> Finding:
    values = [f"{name} {status.values[name]}" for name in _SHOWN if name in status.values]
    text = f"{whose}: {status.message}" + (f" ({', '.join(values)})" if values else "")
    if status.level is Level.OK:
        return ok(subject, text)
    return (warn if status.level is Level.WARN else fail)(subject, text, _JOURNAL)
