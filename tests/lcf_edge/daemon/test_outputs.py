"""The daemon's sinks: each gets every frame, and one that fails costs itself alone."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.samples import Frame, ImuSample
from lcf_edge.config import Config
from lcf_edge.daemon.outputs import Outputs
from lcf_edge.daemon.scenes import LinkedScenes
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import CIRCLE, PSI_REGION, PipelineScene, View
from lcf_edge.sinks import SinkError
from lcf_edge.sinks.results import ResultsSink
from lcf_edge.sinks.sink import Sink

FRAME = Frame(5, 7, np.zeros((4, 4), np.uint8))
SCENE = PipelineScene(5, 7, 4, 4, 1.5, np.empty(0, CIRCLE), np.empty(0, PSI_REGION))


def view() -> View:
    pytest.fail("nobody looks")


class Kept(Sink):
    """Keeps what it gets; ``fails``: with this, at the next frame or at its end."""

    name = "kept"

    def __init__(self, fails: str = "") -> None:
        self.fails = fails
        self.got: list[object] = []

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:  # noqa: ARG002
        self._fail()
        self.got.append((frame, scene))

    def put_sample(self, sample: object) -> None:
        self.got.append(sample)

    def close(self) -> None:
        self._fail()

    def _fail(self) -> None:
        if self.fails:
            raise SinkError(self.fails)


def test_two_methods_make_a_sink_and_the_rest_does_nothing(tmp_path: Path) -> None:
    results = tmp_path / "results.jsonl"
    outputs = Outputs([ResultsSink(str(results))])
    outputs.start()
    outputs.put(FRAME, SCENE, view)
    outputs.put_sample(ImuSample(5, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    outputs.put_diagnostics(5, [DeviceStatus("camera", Level.OK, "delivers")])
    outputs.show_config(Config())
    assert outputs.statuses() == outputs.sheddings() == []
    outputs.close()
    outputs.join(0)
    assert results.read_text(encoding="utf-8").startswith('{"stamp_ns":5,"seq":7,')


def test_a_sink_that_fails_is_left_out_and_reported_once(link: Any, caplog: pytest.LogCaptureFixture) -> None:
    failing, kept = Kept("disk/full: cannot be written"), Kept()
    outputs = Outputs([LinkedScenes(link), failing, kept])
    for _ in range(3):
        outputs.put(FRAME, SCENE, view)
        outputs.put_sample(ImuSample(5, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert len(link.scenes) == 3
    assert len(kept.got) == 6
    assert failing.got == []
    outputs.close()
    assert outputs.statuses() == [DeviceStatus("kept", Level.ERROR, "disk/full: cannot be written")]
    assert [record.getMessage() for record in caplog.records] == [
        "kept: disk/full: cannot be written; continuing without it"
    ]


def test_what_cannot_be_finished_keeps_no_other_from_its_end(caplog: pytest.LogCaptureFixture, tmp_path: Path) -> None:
    results = ResultsSink(str(tmp_path / "results.jsonl"))
    outputs = Outputs([Kept("disk/full: cannot be written"), results])
    outputs.close()
    assert len(caplog.records) == 1
    with pytest.raises(ValueError, match="closed file"):
        results.put(FRAME, SCENE, view)


def test_a_sink_that_does_not_end_is_left_behind_and_named(caplog: pytest.LogCaptureFixture) -> None:
    class Stuck(Kept):
        name = "stuck"

        def join(self, timeout_s: float) -> bool:
            return timeout_s > 1

    Outputs([Stuck(), Kept()]).join(0.5)
    assert [record.getMessage() for record in caplog.records] == ["stuck: does not end in time; abandoned"]


def test_of_a_sink_only_put_and_close_must_be_written() -> None:
    class Idle(Sink):
        name = "idle"

    with pytest.raises(TypeError, match="close"):
        Idle()  # type: ignore[abstract]
