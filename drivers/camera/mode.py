"""What a camera granted."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mode:
    """Format, size of the images that are delivered, rate; and how they lie in a buffer."""

    pixel_format: str
    width: int
    height: int
    stride: int  # bytes from one row to the next
    fps: float
    reduction: int = 1  # by how much larger the images in the buffers are, which are JPEGs
