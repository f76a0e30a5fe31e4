"""The header of a JPEG, parsed as the decoder does, so that its size is known before memory is allocated.

A header that the decoder might parse differently is refused: only fill bytes may lie between segments, and only
segments whose length is unambiguous are accepted.
Source: ITU-T T.81, annex B.
"""

from dataclasses import dataclass

_FRAMES = frozenset({0xC0, 0xC1, 0xC2, 0xC9, 0xCA})  # baseline, extended, progressive; and arithmetic ones
_PROGRESSIVE = frozenset({0xC2, 0xCA})
_SCAN = 0xDA
_PASSED_OVER = frozenset({0xC4, 0xCC, 0xDB, 0xDC, 0xDD, 0xFE, *range(0xE0, 0xF0)})  # tables, application data, comment


@dataclass(frozen=True, slots=True)
class JpegHeader:
    """Everything up to the first entropy-coded data.

    ``samples``: of all components together. ``one_pass``: the first scan contains all of them, so that the decoder
    works row by row; else it keeps every sample in two bytes until the last scan. ``data_at``: offset of the coded
    data.
    """

    width: int
    height: int
    samples: int
    one_pass: bool
    data_at: int


def jpeg_header(jpeg: bytes) -> JpegHeader | None:
    """Return the header of ``jpeg``; None: no JPEG, truncated, or ambiguous."""
    if not jpeg.startswith(b"\xff\xd8"):
        return None
    frame: tuple[int, bytes] | None = None
    at = 2
    while at < len(jpeg) and jpeg[at] == 0xFF:
        while jpeg[at : at + 2] == b"\xff\xff":  # fill bytes
            at += 1
        marker, length = int.from_bytes(jpeg[at + 1 : at + 2]), int.from_bytes(jpeg[at + 2 : at + 4])
        segment = jpeg[at + 4 : at + 2 + length]
        at += 2 + length
        if length < 2 or at > len(jpeg):
            return None
        if marker == _SCAN:
            return _header(frame, segment, at)
        if marker in _FRAMES and frame is None:
            frame = marker, segment
        elif marker not in _PASSED_OVER:
            return None
    return None


def _header(frame: tuple[int, bytes] | None, scan: bytes, data_at: int) -> JpegHeader | None:
    if frame is None or not scan:
        return None
    marker, segment = frame
    components = [segment[at] for at in range(7, len(segment), 3)]  # their sampling factors, 4 bits each
    if len(segment) < 9 or len(segment) != 6 + 3 * segment[5] or any(f >> 4 == 0 or f & 15 == 0 for f in components):
        return None
    height, width = int.from_bytes(segment[1:3]), int.from_bytes(segment[3:5])
    across, down = max(f >> 4 for f in components), max(f & 15 for f in components)
    share = sum((f >> 4) * (f & 15) for f in components) / (across * down)
    one_pass = marker not in _PROGRESSIVE and scan[0] == len(components)
    return JpegHeader(width, height, round(width * height * share), one_pass, data_at)
