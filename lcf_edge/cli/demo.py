"""``lcf-edge demo``: everything from image to subscriber, on a drive that it renders itself.

A rendered drive is written as a recording, replayed through the real pipeline, published over Zenoh on
loopback and received in a second process. Rendering has a process of its own, and drawing comes after the
measured run, so that speed and memory are those of the filter and its link.
"""

import os
import re
import shlex
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

import cv2
import msgspec
import numpy as np
import zenoh

from lcf_edge.cli.demo_subscriber import Received
from lcf_edge.cli.findings import FoundThreat, findings, trusted_rebels
from lcf_edge.cli.replay import frame_rate
from lcf_edge.cli.summary import Summary
from lcf_edge.config import Camera, Config, Vehicle, Zenoh, to_toml
from lcf_edge.doctor.program import SYSTEM_PATH, program
from lcf_edge.errors import LcfError, PublishError, UsageError
from lcf_edge.messages import Cause
from lcf_edge.pipeline import run
from lcf_edge.printable import counted
from lcf_edge.recording.read import Recording, open_recording
from lcf_edge.rendered import scenes
from lcf_edge.sinks import cannot_write, check_output
from lcf_edge.sinks.overlay import draw
from lcf_edge.sinks.results import ResultsSink
from lcf_edge.sinks.sink import Sink
from lcf_edge.sinks.size_plot import SizePlot
from lcf_edge.sinks.video import VideoSink
from lcf_edge.zenoh_link import ScenePublisher, close_session, open_session

SEED = 1
DRAWN_FRAMES = 4

_SUBSCRIBER_STARTS_S = 20.0
_SUBSCRIBER_ENDS_S = 20.0

Say = Callable[[str], None]
Output = TypeVar("Output", SizePlot, VideoSink)


def demo(folder: Path, seconds: float, say: Say) -> None:
    """Run the demo into ``folder`` and report each stage and the outcome. Raises ``LcfError``."""
    drive = _drive(seconds)
    _prepare(folder)
    say(f"1/5 rendering {seconds:g} s of a drive past objects and walkers: {folder / 'recording'}")
    _render(drive, folder / "recording")
    config = Config(
        camera=Camera(height_m=drive.camera_height_m, pitch_rad=drive.camera_pitch_rad),
        vehicle=Vehicle(half_width_m=drive.half_width_m, horizon_s=drive.horizon_s),
    )
    recording = open_recording(folder / "recording", config)
    plot = _unless_missing("plot", lambda: SizePlot(folder / "sizes.png"), say)
    rate = frame_rate(recording, config)
    video = _unless_missing("video", lambda: VideoSink(folder / "overlay.webm", rate), say)

    with ExitStack() as stack:
        session, endpoint = _open_link()
        stack.callback(close_session, session)
        publisher = ScenePublisher(session, config.publish)
        subscriber = stack.enter_context(_subscriber(endpoint, publisher.key))
        if not publisher.wait_for_subscriber(_SUBSCRIBER_STARTS_S):
            raise PublishError(f"{endpoint}: the demo's subscriber could not connect; is loopback filtered?")
        say(f"2/5 {publisher.key} on {endpoint}, subscriber in process {subscriber.pid}")

        say(f"3/5 filtering and publishing: {folder / 'results.jsonl'}")
        summary = Summary(config.memory)
        rebels: dict[int, list[tuple[float, float, Cause]]] = {}
        max_psi = (0, 0)
        sinks: list[Sink] = [stack.enter_context(ResultsSink(str(folder / "results.jsonl")))]
        if plot is not None:
            sinks.append(plot)
        for frame, outcome in run(recording, config):
            scene = outcome.scene
            publisher.put(scene)
            for sink in sinks:
                sink.put(frame, scene, outcome.view)
            summary.add(scene)
            rebels[scene.seq] = trusted_rebels(scene, config.filter.tr_s)
            max_psi = max(max_psi, (scene.sizes.psi, scene.seq))
        received = _finish(subscriber, publisher.sent)
        memory_mib = peak_resident_mib()

    (default,) = config.zenoh.listen
    _write(folder / "config.toml", to_toml(config).encode())
    threats = findings(scenes.truths(drive), rebels)
    found_seqs = [threat.found_seq for threat in threats if threat.found_seq is not None]
    drawn = sorted({max_psi[1], *found_seqs[: DRAWN_FRAMES - 1]})
    say(f"4/5 drawing what the filter saw: {folder}")
    _draw(recording, config, folder, drawn, video)
    if plot is not None:
        say(f"5/5 plotting the sizes of the tables: {plot.path}")
        plot.close()
    for warning in recording.warnings:
        say(f"    warning: {warning}")
    say("")
    for line in (
        *(_found_line(threat) for threat in threats),
        *summary.lines(recording.skipped),
        f"memory   {memory_mib:.0f} MiB at most, of the process that filters and publishes",
        f"received {received.scenes} of {publisher.sent} scenes in the second process, "
        f"{received.bytes / 1e3:.0f} kB, {counted(received.objects, 'object')}, {counted(received.circles, 'circle')}, "
        f"{received.broken} broken",
        "",
        *_next_lines(folder, default, endpoint == default),
    ):
        say(line)


def _unless_missing(what: str, make: Callable[[], Output], say: Say) -> Output | None:
    """Return an output, or None with a message where its library is missing."""
    try:
        return make()
    except UsageError as error:
        say(f"    no {what}: {error}")
        return None


def peak_resident_mib() -> float:
    """Return the peak resident memory of this process, MiB; unlike ``ru_maxrss`` without that of its parent."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    peak = re.search(r"^VmHWM:\s+(\d+) kB", status, re.MULTILINE)
    return int(peak[1]) / 1024 if peak else float("nan")


def _drive(seconds: float) -> scenes.Drive:
    """Return a drive with clutter on both sides, a walker from each side, and an oncoming cart."""
    drive = scenes.make("two_crossing", SEED, seconds=seconds)
    contact_s, speed_mps = seconds + 0.8, 1.2
    ahead_m = float(drive.speed.integral(np.array([contact_s]))[0])
    path = ((0.0, 0.0, ahead_m + speed_mps * contact_s), (contact_s, 0.0, ahead_m))
    paint = scenes.Paint(SEED, feature_m=0.18)
    cart = scenes.Box("cart", 1.2, 1.1, 1.6, path, heading_rad=np.pi, paint=paint)
    return replace(drive, boxes=(*drive.boxes, cart))


def _prepare(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(folder, error) from error
    check_output(folder / "results.jsonl")


def _render(drive: scenes.Drive, folder: Path) -> None:
    """Render in a process of its own, so that textures do not count as memory of the filter."""
    context = get_context("spawn")
    ignore = (signal.SIGINT, signal.SIG_DFL)  # it ends silently when interrupted
    try:
        with ProcessPoolExecutor(1, context, initializer=signal.signal, initargs=ignore) as pool:
            pool.submit(scenes.write, drive, folder).result()
    except OSError as error:
        raise cannot_write(folder, error) from error
    except BrokenProcessPool as error:
        raise LcfError(f"{folder}: the rendering process was killed; free memory, try again") from error


def _open_link() -> tuple[zenoh.Session, str]:
    """Return a session that listens on the usual port, or a free one if that is in use, and its endpoint."""
    default = Zenoh()
    try:
        return open_session(default), default.listen[0]
    except PublishError:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
        return open_session(Zenoh(listen=[endpoint])), endpoint


def _subscriber(endpoint: str, key: str) -> subprocess.Popen[str]:
    # A session of its own: an interrupt reaches it as the end of its input, not as a signal.
    return subprocess.Popen(
        [sys.executable, "-m", "lcf_edge.cli.demo_subscriber", endpoint, key],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def _finish(subscriber: subprocess.Popen[str], sent: int) -> Received:
    try:
        received, _ = subscriber.communicate(f"{sent}\n", timeout=_SUBSCRIBER_ENDS_S)
        return msgspec.json.decode(received, type=Received)
    except (subprocess.TimeoutExpired, msgspec.DecodeError) as error:
        subscriber.kill()
        raise PublishError("the demo's subscriber did not report what it received; try again") from error


def _draw(recording: Recording, config: Config, folder: Path, drawn: list[int], video: VideoSink | None) -> None:
    """Draw in a second run: the same input gives the same output."""
    with video or nullcontext():
        for frame, outcome in run(recording, config):
            panels = draw(frame.image, outcome.scene, outcome.view())
            if video is not None:
                video.write(panels)
            if frame.seq in drawn:
                png = cv2.imencode(".png", panels)[1].tobytes()
                _write(folder / f"picture-{drawn.index(frame.seq) + 1}.png", png)


def _write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except OSError as error:
        raise cannot_write(path, error) from error


def _found_line(threat: FoundThreat) -> str:
    if threat.latency_s is None:
        return f"missed   {threat.name}, in view for {(threat.last_ns - threat.since_ns) / 1e9:.1f} s"
    ((cause, _),) = threat.causes.most_common(1)
    return f"found    {threat.name}, {cause.name.lower()}, {threat.latency_s:.2f} s after it became a threat"


def _next_lines(folder: Path, endpoint: str, free: bool) -> list[str]:
    """Return the commands that show the demo in a browser, and at a subscriber to ``endpoint``, which may be taken."""
    called = program(Path(_shorter(sys.prefix)), os.environ.get("PATH", SYSTEM_PATH))
    what = f"{shlex.quote(str(folder / 'recording'))} -c {shlex.quote(str(folder / 'config.toml'))}"
    code = (
        "from lcf_edge.client import scenes; "
        f"[print(s.seq, s.objects[['class_id', 'range', 'ttc', 'ttc_sigma']]) for s in scenes('{endpoint}')]"
    )
    return [
        "To look at it in a browser:",
        f"  {called} view {what}",
        "To publish it in one terminal and subscribe in another:",
        *([] if free else [f"(after you have stopped what has {endpoint} now)"]),
        f"  {called} replay {what} --publish --realtime",
        f'  {shlex.quote(_shorter(sys.executable))} -c "{code}"',
    ]


def _shorter(path: str) -> str:
    return min(path, os.path.relpath(path), key=len)
