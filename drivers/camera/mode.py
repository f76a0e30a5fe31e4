"""What a camera granted."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mode:
    """Format, delivered image size, rate, and layout in a buffer."""

    pixel_format: str
    width: int
    height: int
    stride: int  # bytes from one row to the next
    fps: float
    reduction: int = 1  # factor by which the JPEGs in the buffers are larger
