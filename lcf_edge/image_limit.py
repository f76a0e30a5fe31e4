"""How large a picture may be: checked by its header, and once more by the decoder."""

import os

MAX_PIXELS = 2**25
"""8K; a picture of more is refused, for a small file can decode to gigabytes."""


def limit_opencv() -> None:
    """OpenCV refuses what is larger, on every way into it. Only before it is loaded, and only for a whole program."""
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
