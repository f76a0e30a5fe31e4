"""Compares a camera's formats: ``python -m hil_mocks.vm.guest.formats DEVICE WIDTH HEIGHT``.

Takes an image in each format that can be read; a line for each: its name, and the largest difference to GREY among
99 % of the pixels. The camera shows a still image; that Y of colours goes from 16 to 235 is no difference.
"""

import sys
from contextlib import closing

import numpy as np

from drivers.camera import offers
from drivers.camera.find import open_camera_node
from drivers.camera.luminance import PIXEL_FORMATS, Grey
from drivers.camera.v4l2 import V4l2Camera


def taken(device: str, pixel_format: str, width: int, height: int) -> Grey:
    """The first image in that format."""
    with closing(V4l2Camera(device, width=width, height=height, fps=25.0, pixel_format=pixel_format)) as camera:
        while not (frames := camera.read()):
            pass
    return frames[-1].image


def main(device: str, width: int, height: int) -> None:
    """Compare all formats."""
    with closing(open_camera_node(device)) as node:
        offered = set(offers.formats(node))
    names = [name for name in PIXEL_FORMATS if name in offered]
    images = {name: taken(device, name, width, height) for name in names}
    grey = images["GREY"].astype(float)
    for name, image in images.items():
        difference = min(np.percentile(np.abs(image - like), 99) for like in (grey, 16 + grey * (235 - 16) / 255))
        sys.stdout.write(f"{name} {difference:.1f}\n")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
