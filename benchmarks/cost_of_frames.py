"""``python cost_of_frames.py FOLDER PART FRAMES``: the program that ``benchmarks.cost`` measures; runs FRAMES frames.

PART is ``detect`` (corners alone) or ``whole`` (the pipeline). All frames of FOLDER are read whatever their number, so
that two runs differ in nothing else.
"""

import sys
from pathlib import Path

import cv2

from drivers.samples import Frame
from lcf_edge.compilation import uncompiled
from lcf_edge.config import Config
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.errors import LcfError
from lcf_edge.lens import Lens
from lcf_edge.pipeline import Pipeline
from lcf_edge.recording.read import open_recording


def run(folder: Path, part: str, frames: int) -> None:
    """Raises ``LcfError`` where the filter runs uncompiled."""
    if uncompiled():
        raise LcfError(uncompiled())
    cv2.setNumThreads(1)
    config = Config()
    recording = open_recording(folder, config)
    events = list(recording)
    first = next(event for event in events if isinstance(event, Frame))
    height, width = first.image.shape
    lens = recording.lens or Lens.from_config(config.camera, width, height)
    detector = CornerDetector(config.filter, lens, config.memory.corners)
    pipeline = Pipeline(config, lens)
    for event in events:
        if not isinstance(event, Frame):
            if part == "whole":
                pipeline.add(event)
            continue
        if frames == 0:
            break
        frames -= 1
        if part == "whole":
            pipeline.process(event)
        else:
            detector.detect(event.image)


if __name__ == "__main__":
    run(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
