"""Simultaneous rotations of the camera and samples of the IMU, for ``by_camera`` and ``time_offset``."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from drivers.samples import Frame, ImuSample
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.image_rotation import Turn, turn
from lcf_edge.calibrate.sources import SensorSource, for_a_while
from lcf_edge.calibrate.tracks import Tracker
from lcf_edge.config import Config
from lcf_edge.lens import Lens
from lcf_edge.printable import counted

LIVE_S = 20.0

_BRISK_RADPS = 0.15


@dataclass
class Watched:
    """``guessed``: the lens is unknown, and taken from the field of view."""

    turns: list[Turn] = field(default_factory=list)
    samples: list[ImuSample] = field(default_factory=list)
    guessed: bool = False
    brisk_s: float = 0.0  # of turning fast enough

    def add(self, turned: Turn) -> None:
        """One interval."""
        self.turns.append(turned)
        if np.hypot(*turned.rate_radps[:2]) > _BRISK_RADPS:
            self.brisk_s += (turned.end_ns - turned.start_ns) * 1e-9


def watch(source: SensorSource, config: Config, seconds: float | None, guide: Guide) -> Watched:
    """Return all turns and samples of ``source``; live for ``seconds`` (20). Raises what ``source`` raises."""
    if source.live:
        seconds = seconds or LIVE_S
        guide.say(
            f"Turn it in place for {seconds:g} s: to and fro, nod, tilt, briskly and unevenly, before something still "
            "that is some metres away."
        )
    watched, tracker = Watched(), None
    for item in for_a_while(source.items(), seconds, Frame):
        if isinstance(item, ImuSample):
            watched.samples.append(item)
            continue
        if tracker is None:
            lens, watched.guessed = lens_of(source, config, item)
            tracker = Tracker(lens)
        tracks = tracker.add(item)
        if tracks is not None:
            watched.add(turn(tracks, travel(config)))
        guide.progress(
            f"{len(watched.turns)} images, {len(watched.samples)} samples, {watched.brisk_s:.0f} s of brisk turning"
        )
    guide.end()
    if tracker is not None:
        for reason, count in tracker.left_out.items():
            guide.say(f"left out: {counted(count, 'interval')}, {reason}")
    return watched


def lens_of(source: SensorSource, config: Config, frame: Frame) -> tuple[Lens, bool]:
    """The lens for ``frame``, and whether it is only guessed."""
    height, width = frame.image.shape
    lens = source.lens(width, height)
    return (lens, False) if lens else (Lens.from_config(config.camera, width, height), True)


def travel(config: Config) -> npt.NDArray[np.float64]:
    """The direction of travel in camera axes, by the configured mounting."""
    return np.array([-np.tan(config.camera.yaw_rad), np.tan(config.camera.pitch_rad), 1.0])
