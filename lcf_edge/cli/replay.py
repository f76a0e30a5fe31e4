"""``lcf-edge replay``: runs the pipeline over a recording, with the requested outputs."""

import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from itertools import count, islice
from pathlib import Path

import numpy as np
from tqdm import tqdm

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.cli.summary import Summary
from lcf_edge.config import Config
from lcf_edge.errors import UsageError
from lcf_edge.pipeline import Outcome, lens_of, run
from lcf_edge.recording.pace import Pace
from lcf_edge.recording.read import Recording, open_recording
from lcf_edge.sinks.results import ResultsSink
from lcf_edge.sinks.sink import Sink
from lcf_edge.sinks.size_plot import SizePlot
from lcf_edge.sinks.video import VideoSink

Say = Callable[[str], None]

_SLOWEST_VIDEO, _FASTEST_VIDEO = 2.0, 120.0  # frames/s


@dataclass(frozen=True, slots=True)
class Outputs:
    """The outputs of a replay."""

    results: str | None = None  # a file, "-": standard output
    video: Path | None = None
    plot: Path | None = None
    publish: bool = False
    recording: Path | None = None


def replay(path: Path, config: Config, outputs: Outputs, pace: Pace, warn: Say) -> list[str]:
    """Run the pipeline over a recording. Return the summary, line by line.

    ``outputs.recording`` is a new MCAP file, with images, samples and results. ``warn`` gets the recording's
    warnings, also when the replay fails. Raises ``RecordingError`` for a recording without a usable frame,
    ``SinkError`` for an output that cannot be written, ``CdrError``, ``PublishError``, ``UsageError``.
    """
    recording = open_recording(path, config)
    recording.start_s, recording.duration_s = pace.start_s, pace.duration_s
    summary = Summary(config.memory)
    try:
        _run(recording, config, outputs, pace, summary)
    finally:
        for warning in recording.warnings:
            warn(f"{warning}")
    return summary.lines(recording.skipped)


def _run(recording: Recording, config: Config, outputs: Outputs, pace: Pace, summary: Summary) -> None:
    for output in (outputs.results, outputs.video, outputs.plot):
        _refuse_input(recording.path, output)
    if outputs.recording is not None and pace.loop:
        raise UsageError(f"{outputs.recording}: holds a drive once; leave --loop or --mcap out")
    with ExitStack() as stack:
        sinks = [stack.enter_context(sink) for sink in _sinks(recording, config, outputs)]
        whole = pace.start_s == 0 and pace.duration_s == math.inf and not pace.loop
        steps = tqdm(
            _paced(recording, config, pace, sinks),
            total=recording.frame_count if whole else None,
            unit="frame",
            disable=pace.step or None,  # unless standard error is a terminal
            file=sys.stderr,
            ncols=_terminal_columns(),
        )
        for frame, outcome in stack.enter_context(steps):
            for sink in sinks:
                sink.put(frame, outcome.scene, outcome.view)
            summary.add(outcome.scene)


def _sinks(recording: Recording, config: Config, outputs: Outputs) -> Iterator[Sink]:
    """Open each output that is wanted."""
    if outputs.publish:
        from lcf_edge.sinks.scenes import SceneSink  # noqa: PLC0415  # starts the network, so only when wanted

        yield SceneSink(config)
    if outputs.results is not None:
        yield ResultsSink(outputs.results)
    if outputs.video is not None:
        yield VideoSink(outputs.video, frame_rate(recording, config))
    if outputs.plot is not None:
        yield SizePlot(outputs.plot)
    if outputs.recording is not None:
        from lcf_edge.sinks.recording import RecordingSink  # noqa: PLC0415  # loads the writer, so only when wanted

        yield RecordingSink(outputs.recording, config, partial(lens_of, recording))


def _terminal_columns() -> int:
    """Return the width of the terminal at standard error; 80 where unknown, as on a serial line."""
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns or 80
    except OSError:
        return 80


def frame_rate(recording: Recording, config: Config) -> float:
    """Return the rate for a video, frames/s, by the stamps of the first frames. Raises ``RecordingError``."""
    frames = (item.stamp_ns for item in recording if isinstance(item, Frame))
    intervals_s = np.diff(list(islice(frames, 9))) / 1e9
    rate = 1 / np.median(intervals_s) if len(intervals_s) else config.camera.fps
    return float(np.clip(rate, _SLOWEST_VIDEO, _FASTEST_VIDEO))


def _paced(recording: Recording, config: Config, pace: Pace, sinks: Sequence[Sink]) -> Iterator[tuple[Frame, Outcome]]:
    """Yield each frame with its outcome, when it is due; if looped, each lap starts with an empty filter.

    ``sinks`` get each sample.
    """

    def take(sample: ImuSample | SpeedSample) -> None:
        for sink in sinks:
            sink.put_sample(sample)

    for lap in count():
        if lap and not pace.loop:
            return
        begun: tuple[float, int] | None = None
        for frame, outcome in run(recording, config, take):
            if pace.step and not _next_asked_for(frame):
                return
            if pace.speed is not None and not pace.step:
                since_s, first_ns = begun = begun or (time.monotonic(), frame.stamp_ns)
                due_s = since_s + (frame.stamp_ns - first_ns) / 1e9 / pace.speed
                time.sleep(max(due_s - time.monotonic(), 0.0))
            yield frame, outcome


def _next_asked_for(frame: Frame) -> bool:
    """Wait for a line on standard input. Return False at its end."""
    sys.stderr.write(f"image {frame.seq}: Enter shows it, Ctrl-D ends\n")
    sys.stderr.flush()
    return sys.stdin.readline() != ""


def _refuse_input(recording: Path, output: Path | str | None) -> None:
    """Raise ``UsageError`` if an output would overwrite the recording."""
    if output not in {None, "-"} and Path(output).exists() and Path(output).samefile(recording):
        raise UsageError(f"{output}: is the recording itself; name another file to write")
