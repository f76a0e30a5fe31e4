"""Profile of one drive: time of each step of the filter, and of each part of a frame in the daemon."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.methods import FILTER, FilterMethod
from benchmarks.playing import feed
from drivers.camera.luminance import luminance
from lcf_edge.cdr import encode_scene
from lcf_edge.config import Config, Zenoh
from lcf_edge.lens import Lens
from lcf_edge.messages import Scene
from lcf_edge.pipeline import Pipeline
from lcf_edge.rendered.drives import Drive
from lcf_edge.zenoh_link import opened_session
from lcf_edge.zenoh_link.publisher import MessagePublisher
from lcf_edge.zenoh_link.scene import SCENE

STEPS = {
    "_take": "0. corners taken, sorted by cells",
    "_derotate": "0. rotation out, circles and ψ predicted",
    "_predict": "1. edges predicted",
    "_omit": "2. ψ omits, and looks in passing",
    "_collect": "2. λ groups",
    "_find": "3. corners found for edges",
    "_refine": "3. rotation that the gyro missed",
    "_update": "4. edges classified, updated, deleted",
    "_add": "4. new edges",
    "_detect": "5. key frame, α, rebels",
    "_update_circles": "6. circles, 7. feedback",
}
FRAME_READ, SAMPLES, MESSAGE, PUT = "image out of a YUYV buffer", "samples taken", "scene as a message", "put"
_WARM_UP = 20


@dataclass(frozen=True, slots=True)
class Stage:
    """One step of the filter; µs a frame, medians."""

    name: str
    median: float
    share: float  # of all steps


def measure(drive: Drive, config: Config) -> list[Stage]:
    """Run the drive and time each step of the filter."""
    method = FilterMethod(config, Lens.from_config(config.camera, drive.lens.width, drive.lens.height))
    spent = {name: _timed(method.pipeline.filter, path) for path, name in STEPS.items()}
    for _ in feed(drive, {FILTER: method}):
        pass
    return _stages(spent)


def measure_frame(drive: Drive, config: Config) -> list[Stage]:
    """Run the drive as the daemon would, from the driver's buffer to the put, and time each part of a frame."""
    method = FilterMethod(config, Lens.from_config(config.camera, drive.lens.width, drive.lens.height))
    spent = _parts(method.pipeline)
    samples_us = _timed(method.pipeline, "add")
    spent |= {name: [] for name in (FRAME_READ, SAMPLES, MESSAGE, PUT)}
    with opened_session(Zenoh(listen=[])) as session:
        publisher = MessagePublisher(session, config.publish, SCENE)
        for moment in feed(drive, {FILTER: method}):
            height, width = moment.frame.image.shape
            buffer = memoryview(np.stack([moment.frame.image] * 2, axis=2).tobytes())
            _note(spent[FRAME_READ], luminance, "YUYV", buffer, width, height, 2 * width)
            scene: Scene = moment.scenes[FILTER]
            message = _note(spent[MESSAGE], encode_scene, scene, config.publish.frame_id)
            _note(spent[PUT], publisher.put, message)
            spent[SAMPLES].append(sum(samples_us))
            samples_us.clear()
    return _stages(spent)


def _parts(pipeline: Pipeline) -> dict[str, list[float]]:
    """Of what the pipeline does with a frame."""
    parts = vars(pipeline)
    parts["_stillness"] = SimpleNamespace(look=parts["_stillness"].look)  # nothing can be set on what is compiled
    steps = (
        (parts["_repeats"], "is_repeat", "whether the image repeats the last one"),
        (parts["_small_image"], "of", "downscaled image"),
        (parts["_detector"], "detect", "corners"),
        (parts["_quality"], "notes", "what is wrong with the image"),
        (parts["_stillness"], "look", "whether the image stands still"),
        (parts["_motion"], "advance", "ego-motion"),
        (pipeline, "_see_rotation", "rotation from the image"),
        (pipeline.filter, "step", "filter"),
        (parts["_motion"], "correct", "ego-motion learns from the flow"),
        (pipeline, "_circles", "circles for the scene"),
        (pipeline, "_objects", "objects for the scene"),
        (pipeline, "_psi", "ψ for the scene"),
    )
    return {name: _timed(owner, path) for owner, path, name in steps}


def _stages(spent: dict[str, list[float]]) -> list[Stage]:
    medians = {name: float(np.median(times_us[_WARM_UP:])) for name, times_us in spent.items()}
    total = sum(medians.values())
    return [Stage(name, median, median / total) for name, median in medians.items()]


def _timed(owner: object, name: str) -> list[float]:
    """Make a method of an object record the time of each call, µs."""
    method: Callable[..., Any] = getattr(owner, name)
    times_us: list[float] = []
    setattr(owner, name, lambda *arguments: _note(times_us, method, *arguments))
    return times_us


def _note(times_us: list[float], function: Callable[..., Any], *arguments: Any) -> Any:
    """Call, and record the time."""
    started = time.perf_counter_ns()
    result = function(*arguments)
    times_us.append((time.perf_counter_ns() - started) / 1000)
    return result
