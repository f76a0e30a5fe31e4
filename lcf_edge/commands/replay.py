"""``lcf-edge replay``: the pipeline over a recording, with what a user wants written."""

import os
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from tqdm import tqdm

from drivers.records import Frame
from lcf_edge.commands.summary import Summary
from lcf_edge.config import Config
from lcf_edge.errors import UsageError
from lcf_edge.pipeline import Outcome, run
from lcf_edge.recordings import Recording, open_recording
from lcf_edge.sinks.overlay import VideoSink, draw
from lcf_edge.sinks.results import ResultsSink
from lcf_edge.sinks.size_plot import SizePlot

Sink = Callable[[Frame, Outcome], object]
Say = Callable[[str], None]

_SLOWEST_VIDEO, _FASTEST_VIDEO = 2.0, 120.0  # frames/s


@dataclass(frozen=True, slots=True)
class Outputs:
    """What a replay writes."""

    results: str | None = None  # a file, "-": standard output
    video: Path | None = None
    plot: Path | None = None
    publish: bool = False
    realtime: bool = False  # as slow as the recording was made


def replay(path: Path, config: Config, outputs: Outputs, warn: Say) -> list[str]:
    """Run the pipeline over a recording; answers with the summary, line by line.

    ``warn`` gets the recording's warnings, also when the replay fails. Raises ``RecordingError`` for a
    recording without a single usable frame, ``SinkError`` for an output that cannot be written,
    ``PublishError``, ``UsageError``.
    """
    recording = open_recording(path, config)
    summary = Summary()
    try:
        _run(recording, config, outputs, summary)
    finally:
        for warning in recording.warnings:
            warn(f"{warning}")
    return summary.lines(recording.skipped)


def _run(recording: Recording, config: Config, outputs: Outputs, summary: Summary) -> None:
    for output in (outputs.results, outputs.video, outputs.plot):
        _refuse_input(recording.path, output)
    with ExitStack() as stack:
        sinks: list[Sink] = []
        if outputs.realtime:
            sinks.append(_pace())
        if outputs.publish:
            sinks.append(_publisher(stack, config))
        if outputs.results is not None:
            results = stack.enter_context(ResultsSink(outputs.results))
            sinks.append(lambda _, outcome: results.write(outcome.scene))
        if outputs.video is not None:
            video = stack.enter_context(video_sink(recording, config, outputs.video))
            sinks.append(lambda frame, outcome: video.write(draw(frame.image, outcome)))
        plot = None if outputs.plot is None else SizePlot(outputs.plot)
        steps = tqdm(
            run(recording, config),
            total=recording.frame_count,
            unit="frame",
            disable=None,  # unless standard error is a terminal
            file=sys.stderr,
            ncols=_terminal_columns(),
        )
        for frame, outcome in stack.enter_context(steps):
            for sink in sinks:
                sink(frame, outcome)
            summary.add(outcome.scene)
            if plot is not None:
                plot.add(outcome.scene.sizes)
        if plot is not None:
            plot.save()


def _terminal_columns() -> int:
    """Width of the terminal behind standard error; 80 where it does not tell, as on a serial line."""
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns or 80
    except OSError:
        return 80


def video_sink(recording: Recording, config: Config, video: Path) -> VideoSink:
    """A video at the recording's own rate and size, which a glance at its first frames tells.

    Raises ``RecordingError``, ``SinkError``, ``UsageError``.
    """
    frames = (item for item in recording if isinstance(item, Frame))
    first = [(frame.stamp_ns, frame.image.shape) for frame in islice(frames, 9)]
    intervals_s = np.diff([stamp_ns for stamp_ns, _ in first]) / 1e9
    rate = 1 / np.median(intervals_s) if len(intervals_s) else config.camera.fps
    height, width = first[0][1]
    return VideoSink(video, float(np.clip(rate, _SLOWEST_VIDEO, _FASTEST_VIDEO)), (2 * width, height))


def _publisher(stack: ExitStack, config: Config) -> Sink:
    # Here, so that a replay that publishes nothing starts no network.
    from lcf_edge.zenoh_link import ScenePublisher, opened_session  # noqa: PLC0415

    session = stack.enter_context(opened_session(config.zenoh))
    publisher = ScenePublisher(session, config.publish)
    return lambda _, outcome: publisher.put(outcome.scene)


def _pace() -> Sink:
    """Hold each result until as much time has passed as lies between its frame and the first."""
    offset_s: float | None = None

    def wait(frame: Frame, _: Outcome) -> None:
        nonlocal offset_s
        now_s, stamp_s = time.monotonic(), frame.stamp_ns / 1e9
        if offset_s is None:
            offset_s = now_s - stamp_s
        time.sleep(max(stamp_s + offset_s - now_s, 0.0))

    return wait


def _refuse_input(recording: Path, output: Path | str | None) -> None:
    """An output must not take the place of the recording."""
    if output not in {None, "-"} and Path(output).exists() and Path(output).samefile(recording):
        raise UsageError(f"{output}: is the recording itself; name another file to write")
