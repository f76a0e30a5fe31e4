"""The recordings of a corpus, with what lies beside each: settings and truth.

Beside a folder means in it, as ``settings`` and ``truth.jsonl``; beside a file ``drive.mcap`` they are called
``drive.settings`` and ``drive.truth.jsonl``.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from lcf_edge.errors import UsageError
from lcf_edge.recording.read import is_recording

MAX_SETTINGS = 2**16  # characters


@dataclass(frozen=True, slots=True)
class Entry:
    """A recording. ``name``: the shortest unique one, in characters that are safe anywhere."""

    name: str
    path: Path

    @property
    def settings(self) -> list[str]:
        """``KEY=VALUE`` words, as for ``--set``. Raises ``OSError``, ``UnicodeDecodeError``."""
        path = self._beside("settings")
        if not path.is_file():
            return []
        with path.open(encoding="utf-8") as file:
            return file.read(MAX_SETTINGS).split()

    @property
    def truth(self) -> Path | None:
        """The file with the truth about the images."""
        path = self._beside("truth.jsonl")
        return path if path.is_file() else None

    def _beside(self, name: str) -> Path:
        if self.path.is_dir():
            return (self.path.parent if self.path.name == "mav0" else self.path) / name
        return self.path.with_name(f"{self.path.stem}.{name}")


def find(places: Sequence[Path]) -> list[Entry]:
    """The recordings that are named; a folder that is not one stands for all in it. Raises ``UsageError``."""
    paths: list[Path] = []
    for place in places:
        found = [place] if not place.is_dir() else list(_below(place))
        if not found:
            raise UsageError(f"{place}: no recording in it; name recordings, or a folder of them")
        paths += found
    paths = list({path.resolve(): path.absolute() for path in reversed(paths)}.values())[::-1]  # without duplicates
    return [Entry(printable_name(name), path) for name, path in zip(_names(paths), paths, strict=True)]


def printable_name(name: str) -> str:
    """Return a file's name with characters that cannot be printed, or decoded, as their codes."""
    return "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode("ascii") for letter in name
    )


def _below(folder: Path) -> Iterator[Path]:
    if is_recording(folder):
        yield folder
        return
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.is_symlink():
            yield from _below(path)
        elif is_recording(path):
            yield path


def _names(paths: Sequence[Path]) -> list[str]:
    """Return the last parts of each path, as many as make it unique."""
    parts = [path.parts[1:-1] if path.name == "mav0" else path.parts[1:] for path in paths]
    taken = [1] * len(paths)
    while repeated := _repeated(_joined(parts, taken)):
        longer = [
            min(count + (name in repeated), len(part))
            for count, name, part in zip(taken, _joined(parts, taken), parts, strict=True)
        ]
        if longer == taken:
            break
        taken = longer
    return _joined(parts, taken)


def _joined(parts: Sequence[tuple[str, ...]], taken: Sequence[int]) -> list[str]:
    return ["/".join(part[-count:]) for part, count in zip(parts, taken, strict=True)]


def _repeated(names: Iterable[str]) -> set[str]:
    return {name for name, count in Counter(names).items() if count > 1}
