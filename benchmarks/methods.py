"""The filter and its peers behind one interface, so that all of them get the same frames and samples."""

import time
from typing import Protocol

import numpy as np

from benchmarks.peers import PEERS, LandmarkMap
from benchmarks.peers.peer import Peer
from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.corners import own_parts
from lcf_edge.ego_motion.estimator import EgoMotionEstimator
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens
from lcf_edge.messages import CIRCLE, PSI_REGION, PipelineScene, Sizes, Timing
from lcf_edge.pipeline import Pipeline

FILTER = "filter"
MAP = "landmark_map"
NOTHING = "nothing"
NAMES = (FILTER, *PEERS)
"""The methods that find circles."""

_CALIBRATED_RADPS = 1e-3  # 1 sigma of a calibrated bias


class Method(Protocol):
    """One method on one drive."""

    def add(self, sample: ImuSample | SpeedSample) -> None:
        """Take a sample, in stamp order."""

    def process(self, frame: Frame) -> PipelineScene:
        """Circles (and ψ) of one frame; ``timing``: how long it took."""


class FilterMethod:
    """The filter, through the pipeline."""

    def __init__(self, config: Config, lens: Lens) -> None:
        self.pipeline = Pipeline(config, lens)

    def add(self, sample: ImuSample | SpeedSample) -> None:
        """Take a sample, in stamp order."""
        self.pipeline.add(sample)

    def process(self, frame: Frame) -> PipelineScene:
        """Circles and ψ of one frame."""
        return self.pipeline.process(frame)


class PeerMethod:
    """A peer, with the filter's own ego-motion."""

    def __init__(self, peer: Peer, config: Config) -> None:
        self.peer = peer
        self._motion = EgoMotionEstimator(config.imu, config.vehicle)
        self._camera = config.camera
        self._motion.bias.see_rest(np.zeros(3), _CALIBRATED_RADPS)  # a peer has nothing to teach it with

    def add(self, sample: ImuSample | SpeedSample) -> None:
        """Take a sample, in stamp order."""
        if isinstance(sample, ImuSample):
            self._motion.add_imu(sample)
        else:
            self._motion.add_speed(sample)

    def process(self, frame: Frame) -> PipelineScene:
        """Circles of one frame."""
        started = time.perf_counter_ns()
        ego = self._motion.advance(frame.stamp_ns)
        circles = self.peer.process(frame.image, ego.to_motion())
        seen = own_parts.in_sight(self._camera, frame.image.shape[1], frame.image.shape[0])
        if seen is not None:  # nobody looks for anything in the vehicle's own parts
            x, y = (
                np.clip(circles[name], 0, most - 1) for name, most in zip("xy", frame.image.shape[::-1], strict=True)
            )
            circles = circles[seen[y.astype(np.intp), x.astype(np.intp)] > 0]
        total_us = (time.perf_counter_ns() - started) // 1000
        height, width = frame.image.shape
        landmarks = self.peer.landmarks if isinstance(self.peer, LandmarkMap) else 0
        return PipelineScene(
            frame.stamp_ns,
            frame.seq,
            width,
            height,
            ego.speed_mps,
            circles,
            np.zeros(0, PSI_REGION),
            sizes=Sizes(edges_normal=landmarks),
            timing=Timing(total=total_us),
        )


class _Nothing:
    """The input that every method needs: images and ego-motion."""

    def __init__(self, config: Config, lens: Lens) -> None:
        del config, lens

    def process(self, image: np.ndarray, motion: Motion) -> np.ndarray:
        del image, motion
        return np.zeros(0, CIRCLE)


def make(name: str, config: Config, lens: Lens) -> Method:
    """The method of a name: one of ``NAMES``, ``MAP``, or ``NOTHING``, which reads the frames and no more."""
    if name == FILTER:
        return FilterMethod(config, lens)
    kinds: dict[str, type[Peer]] = {**PEERS, MAP: LandmarkMap, NOTHING: _Nothing}
    return PeerMethod(kinds[name](config, lens), config)
