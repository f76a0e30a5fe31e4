"""Where recordings go: the names of the files, and how much of the disk they may take."""

import re
import shutil
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Protocol

from lcf_edge.config import Record

MIB = 2**20
_OURS = re.compile(r"lcf-edge-(\d{6,})-\d{8}T\d{6}Z\.mcap")


class Destination(Protocol):
    """Where the next file goes. ``folder``: on whose disk; ``removed``: old files that gave way."""

    folder: Path
    removed: int

    def next(self, system_ns: int) -> Path:
        """The path of a file that begins now. Raises ``OSError``."""
        ...


class Folder:
    """Numbered files in ``record.folder``; the oldest are removed to stay below ``record.total_mib``.

    The number orders them, whatever the clock said: ``lcf-edge-000012-20261121T134100Z.mcap``. Other files in the
    folder are not touched.
    """

    def __init__(self, record: Record) -> None:
        self.folder = Path(record.folder)
        self.removed = 0
        self._room_bytes = (record.total_mib - record.file_mib) * MIB

    def next(self, system_ns: int) -> Path:
        """The path of a file that begins now, with room for it. Raises ``OSError``."""
        self.folder.mkdir(parents=True, exist_ok=True)
        files = self._files()
        number = max(files, default=0) + 1
        sizes = {number: path.stat().st_size for number, path in files.items()}
        for oldest in sorted(files):
            if sum(sizes.values()) <= self._room_bytes:
                break
            files[oldest].unlink()
            del sizes[oldest]
            self.removed += 1
        begun = datetime.fromtimestamp(system_ns / 1e9, UTC)
        return self.folder / f"lcf-edge-{number:06}-{begun:%Y%m%dT%H%M%SZ}.mcap"

    def _files(self) -> dict[int, Path]:
        """Our files by number."""
        named = ((path, _OURS.fullmatch(path.name)) for path in self.folder.iterdir())
        return {int(name[1]): path for path, name in named if name}


class Named:
    """The file that the user names; what does not fit into it goes to ``FILE_2.mcap`` and so on. Nothing is removed."""

    def __init__(self, path: Path) -> None:
        self.folder = path.absolute().parent
        self.removed = 0
        self._path = path

    def next(self, system_ns: int) -> Path:  # noqa: ARG002  # the name is given
        """The first of these that is not there."""
        others = (self._path.with_stem(f"{self._path.stem}_{number}") for number in count(2))
        path = self._path
        while path.exists():
            path = next(others)
        return path


def free_mib(folder: Path) -> float:
    """Free space on the disk of ``folder``, MiB. Raises ``OSError``."""
    return shutil.disk_usage(folder).free / MIB
