"""What is known of the images of a recording: the file ``truth.jsonl`` (docs/evaluate.md)."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import msgspec

from lcf_edge.errors import RecordingError

MIN_BOX_PX = 12.0  # smallest threat that must be found
GROWN_SHARE, GROWN_PX = 0.25, 8.0  # growth of a box on each side; circles within count as on it
MAX_BYTES = 256 * 2**20
MAX_LINE_BYTES = 2**20
MAX_KNOWN = 2_000_000  # images and what is in them, some 200 bytes of memory each
MAX_NAME = 200  # characters
MAX_PX = 1e6  # of a box, from the image's corner

_Px = Annotated[float, msgspec.Meta(ge=-MAX_PX, le=MAX_PX)]


class Known(msgspec.Struct, frozen=True):
    """Something in an image. ``box``: x0, y0, x1, y1, px. ``threat``: it is in the way, straight ahead."""

    name: Annotated[str, msgspec.Meta(max_length=MAX_NAME)]
    box: tuple[_Px, _Px, _Px, _Px]
    threat: bool = False

    @property
    def is_due(self) -> bool:
        """A threat, and large enough to be found."""
        return self.threat and min(self.box[2] - self.box[0], self.box[3] - self.box[1]) >= MIN_BOX_PX

    def holds(self, x: float, y: float) -> bool:
        """Whether a circle with this centre, px, is on it."""
        left, top, right, bottom = self.box
        across, down = GROWN_SHARE * (right - left) + GROWN_PX, GROWN_SHARE * (bottom - top) + GROWN_PX
        return left - across <= x <= right + across and top - down <= y <= bottom + down


class _Line(msgspec.Struct, frozen=True):
    stamp_ns: int
    objects: list[Known] = []


class Truth:
    """What is known, frame by frame. Without a file of truth: that nothing moves or is met."""

    def __init__(self, by_stamp: Mapping[int, Sequence[Known]] | None) -> None:
        self._by_stamp = by_stamp

    @property
    def is_known(self) -> bool:
        """Whether there is a file of truth."""
        return self._by_stamp is not None

    def of(self, stamp_ns: int) -> Sequence[Known] | None:
        """What is in the image of this stamp; None: it is not to be scored."""
        return () if self._by_stamp is None else self._by_stamp.get(stamp_ns)


def read_truth(path: Path | None) -> Truth:
    """Read a file of truth; None: there is none. Raises ``RecordingError``."""
    if path is None:
        return Truth(None)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise RecordingError(f"{path}: too large for a truth file; one line a frame is enough")
        return Truth(_frames(path))
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror}); name another truth file") from error
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: {error}; docs/evaluate.md describes a line of truth") from error


def _frames(path: Path) -> dict[int, list[Known]]:
    decoder = msgspec.json.Decoder(_Line)
    frames: dict[int, list[Known]] = {}
    known = 0
    with path.open("rb") as file:
        while text := file.readline(MAX_LINE_BYTES):
            if len(text) == MAX_LINE_BYTES:
                raise RecordingError(f"{path}: a line of {MAX_LINE_BYTES} bytes or more; shorten it")
            if not text.strip():
                continue
            line = decoder.decode(text)
            frames[line.stamp_ns] = line.objects
            known += 1 + len(line.objects)
            if known > MAX_KNOWN:
                raise RecordingError(f"{path}: more than {MAX_KNOWN} images and things in them; cut the recording")
    return frames
