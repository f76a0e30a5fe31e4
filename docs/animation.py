"""Makes the animation of README: ten seconds of the demo, as ``lcf-edge demo`` leaves them.

make demo
.venv/bin/python docs/animation.py demo-out docs/pictures/overlay.webp
"""

import sys
from pathlib import Path

import cv2
import numpy as np

from lcf_edge.config import load
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording
from lcf_edge.sinks.overlay import Image, draw

EVERY = 2  # of 20 pictures a second
INTERVAL_MS = 100
QUALITY = 30
MAX_BYTES = 2_000_000


def images(demo: Path) -> list[Image]:
    """What becomes of every other frame: the right panel. Grain is smoothed, which costs bytes."""
    config = load(demo / "config.toml", [])
    drawn: list[Image] = []
    for frame, outcome in run(open_recording(demo / "recording", config), config):
        if frame.seq % EVERY == 0:
            smooth = cv2.bilateralFilter(frame.image, 7, 30, 5).astype(np.uint8)
            panel = draw(smooth, outcome.scene, outcome.view())[:, smooth.shape[1] :]
            drawn.append(np.ascontiguousarray(panel))
    return drawn


def write(drawn: list[Image], path: Path) -> int:
    """Write an animated WebP that repeats for ever. Return its size, bytes."""
    animation = cv2.Animation()
    animation.frames = drawn
    animation.durations = np.full(len(drawn), INTERVAL_MS)
    if not cv2.imwriteanimation(str(path), animation, (cv2.IMWRITE_WEBP_QUALITY, QUALITY)):
        raise OSError(f"{path}: cannot be written")
    return path.stat().st_size


if __name__ == "__main__":
    size = write(images(Path(sys.argv[1])), Path(sys.argv[2]))
    sys.exit(f"{size} bytes: too large" if size > MAX_BYTES else 0)
