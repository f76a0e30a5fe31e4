"""A recording through the filter, as in a notebook: how many objects a frame has, and one frame as an image.

python examples/replay.py demo-out/recording demo-out/config.toml frame.png
"""

import sys
from pathlib import Path

import cv2

from lcf_edge.config import load
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording
from lcf_edge.sinks.overlay import draw

recording, config_file, image_path = sys.argv[1:]
config = load(Path(config_file))
counts = []
for frame, outcome in run(open_recording(Path(recording), config), config):
    counts.append(len(outcome.scene.objects))
    if counts[-1] == max(counts):
        cv2.imwrite(image_path, draw(frame.image, outcome.scene, outcome.view()))
print(f"{len(counts)} frames, {sum(counts) / len(counts):.2f} objects a frame, at most {max(counts)}: {image_path}")
