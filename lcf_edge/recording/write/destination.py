"""Where recordings go: the names of the files, and how much of the disk they may take."""

import re
import shutil
import stat
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Protocol

from lcf_edge.config import Record
from lcf_edge.dates import utc

MIB = 2**20
_OURS = re.compile(r"lcf-edge-(\d{6,200})-\d{8}T\d{6}Z\.mcap", re.ASCII)


class Destination(Protocol):
    """Where the next file goes. ``folder``: on the disk of the files; ``removed``: number of old files removed."""

    folder: Path
    removed: int

    def next(self, system_ns: int) -> Path:
        """Return the path of a file that begins now. Raises ``OSError``."""
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
        """Return the path of a file that begins now, and make room for it. Raises ``OSError``."""
        self.folder.mkdir(parents=True, exist_ok=True)
        files = self._files()
        number = max((number for number, *_ in files), default=0) + 1
        taken_bytes = sum(size_bytes for *_, size_bytes in files)
        for _, path, size_bytes in sorted(files):
            if taken_bytes <= self._room_bytes:
                break
            path.unlink(missing_ok=True)
            taken_bytes -= size_bytes
            self.removed += 1
        return self.folder / f"lcf-edge-{number:06}-{utc(system_ns):%Y%m%dT%H%M%SZ}.mcap"

    def _files(self) -> list[tuple[int, Path, int]]:
        """Return number, path and size (bytes) of our files; links and folders do not count."""
        files = []
        for path in self.folder.iterdir():
            name = _OURS.fullmatch(path.name)
            with suppress(FileNotFoundError):  # somebody has removed it meanwhile
                if name and stat.S_ISREG((status := path.lstat()).st_mode):
                    files.append((int(name[1]), path, status.st_size))
        return files


class Named:
    """The file that the user names; the recording continues in ``FILE_2.mcap`` and so on. Nothing is removed."""

    def __init__(self, path: Path) -> None:
        self.folder = path.absolute().parent
        self.removed = 0
        self._path = path

    def next(self, system_ns: int) -> Path:  # noqa: ARG002  # the name is given
        """Return the first of these that does not exist."""
        others = (self._path.with_stem(f"{self._path.stem}_{number}") for number in count(2))
        path = self._path
        while path.exists():
            path = next(others)
        return path


class Bag(Named):
    """The folder that the user names, with files as ``ros2 bag record`` calls them: ``FOLDER/FOLDER_0.mcap``."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder.absolute() / f"{folder.absolute().name}_0.mcap")

    def next(self, system_ns: int) -> Path:  # noqa: ARG002
        """Return the path with the next number."""
        files = (self.folder / f"{self.folder.name}_{number}.mcap" for number in count())
        return next(path for path in files if not path.exists())


def free_mib(folder: Path) -> float:
    """Free space on the disk of ``folder``, MiB. Raises ``OSError``."""
    return shutil.disk_usage(folder).free / MIB
