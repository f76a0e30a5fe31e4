"""What a camera offers: pixel formats, their sizes, and the rates at each size."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

from drivers.camera.v4l2_errors import NOT_IMPLEMENTED
from drivers.camera.v4l2_ioctl import (
    DISCRETE,
    ENUM_FMT,
    ENUM_FRAMEINTERVALS,
    ENUM_FRAMESIZES,
    Argument,
    FormatDescription,
    FrameInterval,
    FrameSize,
    Node,
    fourcc,
    fourcc_text,
)

RATE_TOLERANCE = 0.01  # 29.97 is 30
_MAX_LIST = 256  # guards against a faulty device whose list never ends
_MAX_SIZES = 12


@dataclass(frozen=True, slots=True)
class SizeOffer:
    """A size, or with ``largest`` the range of sizes up to it in steps (width, height), all in px."""

    width: int
    height: int
    largest: tuple[int, int] | None = None
    step: tuple[int, int] = (1, 1)

    def grants(self, width: int, height: int) -> bool:
        """Whether that size is offered."""
        if self.largest is None:
            return (width, height) == (self.width, self.height)
        return all(
            low <= value <= high and (value - low) % max(step, 1) == 0
            for value, low, high, step in zip(
                (width, height), (self.width, self.height), self.largest, self.step, strict=True
            )
        )

    def __str__(self) -> str:
        return f"{self.width}x{self.height}" + (f"..{self.largest[0]}x{self.largest[1]}" if self.largest else "")


@dataclass(frozen=True, slots=True)
class RateOffer:
    """Frames a second: one rate (``slowest`` = ``fastest``) or all between two."""

    slowest: float
    fastest: float

    def grants(self, fps: float) -> bool:
        """Whether that rate is offered, give or take ``RATE_TOLERANCE``."""
        return self.slowest * (1 - RATE_TOLERANCE) <= fps <= self.fastest * (1 + RATE_TOLERANCE)

    def __str__(self) -> str:
        return f"{self.slowest:.4g}" + (f"..{self.fastest:.4g}" if self.fastest > self.slowest else "")


def formats(node: Node) -> list[str]:
    """Pixel formats by four-character code. Raises ``OSError``."""
    listed = _enumerate(node, ENUM_FMT, lambda index: FormatDescription(index=index, type=node.buffer_type))
    return [fourcc_text(description.pixelformat) for description in listed]


def sizes(node: Node, pixel_format: str) -> list[SizeOffer]:
    """Sizes of a pixel format; empty: the device does not say. Raises ``OSError``."""
    listed = _enumerate(node, ENUM_FRAMESIZES, lambda index: FrameSize(index=index, pixelformat=fourcc(pixel_format)))
    offers = []
    for size in listed:
        a, b, c, d, e, f = size.numbers
        offers.append(SizeOffer(a, b) if size.type == DISCRETE else SizeOffer(a, d, (b, e), (c, f)))
    return offers


def rates(node: Node, pixel_format: str, width: int, height: int) -> list[RateOffer]:
    """Rates at a size; empty: the device does not say. Raises ``OSError``."""

    def question(index: int) -> FrameInterval:
        return FrameInterval(index=index, pixelformat=fourcc(pixel_format), width=width, height=height)

    offers = []
    for interval in _enumerate(node, ENUM_FRAMEINTERVALS, question):
        shortest_s, shortest_per, longest_s, longest_per, *_ = interval.numbers
        if interval.type == DISCRETE:
            longest_s, longest_per = shortest_s, shortest_per
        if shortest_s and longest_s:
            offers.append(RateOffer(longest_per / longest_s, shortest_per / shortest_s))
    return offers


def grants(node: Node, pixel_format: str, width: int, height: int, fps: float) -> bool:
    """Whether the device offers this combination, as far as it reports. Raises ``OSError``."""
    offered_sizes = sizes(node, pixel_format)
    if offered_sizes and not any(offer.grants(width, height) for offer in offered_sizes):
        return False
    offered_rates = rates(node, pixel_format, width, height)
    return not offered_rates or any(offer.grants(fps) for offer in offered_rates)


def describe(node: Node, pixel_formats: Sequence[str]) -> list[str]:
    """Lines such as ``YUYV, NV12: 640x480 (15, 30/s), 1280x720 (10/s)``, one for all formats that have the same sizes.

    Raises ``OSError``.
    """
    lines: dict[str, list[str]] = {}
    for pixel_format in pixel_formats:
        lines.setdefault(_describe_sizes(node, pixel_format), []).append(pixel_format)
    return [f"{', '.join(names)}: {described}" for described, names in lines.items()]


def _describe_sizes(node: Node, pixel_format: str) -> str:
    offered = sizes(node, pixel_format)
    described = []
    for offer in offered[:_MAX_SIZES]:
        per_second = ", ".join(map(str, rates(node, pixel_format, offer.width, offer.height)))
        described.append(f"{offer} ({per_second}/s)" if per_second else str(offer))
    return ", ".join(described + ["…"] * (len(offered) > _MAX_SIZES)) or "any size"


def _enumerate(node: Node, request: int, question: Callable[[int], Argument]) -> Iterator[Argument]:
    """Yield the device's answers for index 0, 1, … to the end of its list."""

    def answers() -> Iterator[Argument]:
        index = 0
        while True:
            try:
                yield node.ask(request, question(index))
            except OSError as error:
                if error.errno in NOT_IMPLEMENTED:
                    return
                raise
            index += 1

    return islice(answers(), _MAX_LIST)
