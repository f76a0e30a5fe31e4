"""How large an image may be: checked by its header, and again by the decoder."""

import os

MAX_PIXELS = 2**25
"""Pixels of 8K; larger images are refused, because a small file can decode to gigabytes."""


def limit_opencv() -> None:
    """Let OpenCV itself refuse larger images. Call before it is loaded; holds for the whole process."""
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
