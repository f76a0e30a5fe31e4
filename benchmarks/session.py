"""The daemon in a session: a camera of 30 frames a second, a 200 Hz IMU, and a subscriber in another process.

The subscriber is this process, over Zenoh on loopback. The times do not include exposure and transfer of the image,
nor does the share of a core include the stand-ins' own reading.
"""

import json
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import zenoh
from msgspec.structs import replace as changed

from benchmarks.playing import config_of
from benchmarks.report import Table, number
from lcf_edge.cdr import decode_scene
from lcf_edge.config import Config, Zenoh, to_toml
from lcf_edge.errors import LcfError
from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import Drive, stamp_ns
from lcf_edge.zenoh_link import opened_session

FRAMES_HZ = 30.0
_WARM_UP_S = 3.0
_STARTS_WITHIN_S = 30.0
_ENDS_WITHIN_S = 10.0
_CPU_CLOCK = 2  # CPUCLOCK_SCHED, of the clock that clock_getcpuclockid(3) gives


@dataclass(frozen=True, slots=True)
class Session:
    """Measurements. ``latency_ms``: from an image's stamp to its scene at the subscriber."""

    frame_count: int
    received: int
    latency_p50_ms: float
    latency_p99_ms: float
    core_share: float
    reading_share: float  # of a core, of the stand-ins; not in ``core_share``
    resident_mib: float


def measure(seconds: float, *, drive_s: float = 10.0) -> Session:
    """Run the daemon for ``seconds`` on a looped drive. Raises ``LcfError``."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        drive = replace(scenes.make("two_crossing", 1, seconds=drive_s), fps=FRAMES_HZ)
        save(drive, folder)
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        (folder / "config.toml").write_text(to_toml(config_in(folder, drive, endpoint)), encoding="utf-8")
        return _run(folder, endpoint, seconds)


def config_in(folder: Path, drive: Drive, *listen: str) -> Config:
    """Of a daemon that plays what ``save`` wrote and listens there."""
    config = config_of(drive)
    return changed(
        config,
        camera=changed(config.camera, driver="recording", recording=str(folder)),
        imu=changed(config.imu, driver="recording", time_offset_s=0.0),
        zenoh=Zenoh(listen=list(listen)),
    )


def save(drive: Drive, folder: Path) -> None:
    """Render a drive for ``session_daemon``."""
    count = 0
    with (folder / "images.raw").open("wb") as file:
        for frame, _ in scenes.frames(drive):
            file.write(frame.image.tobytes())
            count += 1
    start_ns = stamp_ns(0.0)
    imu = [((one.stamp_ns - start_ns) / 1e9, *one.gyro, *one.accel) for one in scenes.imu(drive)]
    speed = [((one.stamp_ns - start_ns) / 1e9, one.speed_mps, one.yaw_rate_radps) for one in scenes.odometry(drive)]
    for name, rows in (("imu", imu), ("speed", speed)):
        np.array([row for row in rows if 0 <= row[0] < drive.seconds]).tofile(folder / f"{name}.raw")
    size = {"width": drive.lens.width, "height": drive.lens.height, "seconds": drive.seconds, "count": count}
    (folder / "size.json").write_text(json.dumps(size), encoding="utf-8")


def _run(folder: Path, endpoint: str, seconds: float) -> Session:
    command = (sys.executable, "-m", "benchmarks.session_daemon", folder, "run", "-c", folder / "config.toml")
    log = folder / "log.txt"
    with log.open("wb") as errors:
        daemon = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors)
    try:
        return _listened(daemon, endpoint, seconds)
    except (LcfError, ValueError) as error:
        last = log.read_text("utf-8", "replace").strip().splitlines()[-1:]
        raise LcfError(f"session: {error}; the daemon said: {' '.join(last)}") from error
    finally:
        daemon.kill()
        daemon.communicate()


def _listened(daemon: "subprocess.Popen[bytes]", endpoint: str, seconds: float) -> Session:
    took_ns: list[tuple[int, int]] = []  # of each scene: its number, from stamp to here
    first = threading.Event()

    def take(sample: zenoh.Sample) -> None:
        now_ns = time.time_ns()
        scene = decode_scene(sample.payload.to_bytes())
        took_ns.append((scene.seq, now_ns - scene.stamp_ns))
        first.set()

    with opened_session(Zenoh(mode="peer", connect=[endpoint], listen=[])) as session:
        subscriber = session.declare_subscriber("lcf/scene", take)
        if not first.wait(_STARTS_WITHIN_S):
            raise LcfError("no scene came")
        time.sleep(_WARM_UP_S)
        begun, used_s, from_scene = time.monotonic(), cpu_s(daemon.pid), len(took_ns)
        time.sleep(seconds)
        lasted_s, used_s, to_scene = time.monotonic() - begun, cpu_s(daemon.pid) - used_s, len(took_ns)
        resident_mib = status_mib(daemon.pid, "VmRSS")
        subscriber.undeclare()  # type: ignore[no-untyped-call]
    daemon.send_signal(signal.SIGTERM)
    out, _ = daemon.communicate(timeout=_ENDS_WITHIN_S)
    measured = took_ns[from_scene:to_scene]
    taken = np.array([each for _, each in measured]) / 1e6
    frame_count = measured[-1][0] - measured[0][0] + 1
    read_s = float(out.split()[-1]) / (took_ns[-1][0] - took_ns[0][0] + 1)  # an image
    reading = read_s * frame_count / lasted_s
    return Session(
        frame_count,
        len(measured),
        float(np.percentile(taken, 50)),
        float(np.percentile(taken, 99)),
        used_s / lasted_s - reading,
        reading,
        resident_mib,
    )


def free_port() -> int:
    """Of loopback, for TCP."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def cpu_s(process: int) -> float:
    """Processor time of all threads of a process so far, to the nanosecond: ticks of ``stat`` miss short turns."""
    return time.clock_gettime(~process << 3 | _CPU_CLOCK)


def status_mib(process: int, what: str) -> float:
    """Memory of a process: ``VmRSS`` is resident now, ``VmHWM`` was at its peak."""
    status = Path(f"/proc/{process}/status").read_text("ascii")
    (size_kib,) = (line.split()[1] for line in status.splitlines() if line.startswith(f"{what}:"))
    return int(size_kib) / 1024


def tables(session: Session) -> list[Table]:
    """One table."""
    rows = [
        ["images, and scenes that were received", f"{session.frame_count}, {session.received}"],
        ["stamp to received, ms: median (p99)", f"{session.latency_p50_ms:.1f} ({session.latency_p99_ms:.1f})"],
        ["share of a core", f"{session.core_share:.1%}"],
        ["reading the stand-in's images, not in it", f"{session.reading_share:.1%}"],
        ["resident memory, MiB", number(session.resident_mib, 1)],
    ]
    title = f"The daemon, 640×480 at {FRAMES_HZ:g} frames a second, IMU 200 Hz, a subscriber in another process"
    return [Table(title, ["", "value"], rows)]
