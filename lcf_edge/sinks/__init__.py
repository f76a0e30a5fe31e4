"""Where scenes go: each output is a ``Sink`` (``sink``), used by ``replay`` and by the daemon alike.

JSON lines (``results``), Zenoh (``scenes``), MCAP (``recording``), a video (``video``) of the two panels that
``overlay`` draws, a plot of the tables' sizes (``size_plot``). Sinks that only a running daemon has are in
``lcf_edge/daemon``: ``preview`` and ``recorder``.
"""

from pathlib import Path

from lcf_edge.errors import LcfError, UsageError


class SinkError(LcfError):
    """An output that cannot be written."""


def refuse_existing(path: Path) -> None:
    """Raise ``UsageError`` for a name that is taken, where nothing may be overwritten."""
    if path.exists():
        raise UsageError(f"{path}: already exists; name another file, or remove it")


def check_output(path: Path, suffixes: tuple[str, ...] = ()) -> None:
    """Refuse an output before work begins, without touching an existing file.

    Raises ``UsageError`` when the name does not end in one of ``suffixes``, ``SinkError`` when the file
    cannot be written.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise UsageError(f"{path}: the name must end in {' or '.join(suffixes)}")
    is_new = not path.exists()
    try:
        with path.open("ab"):
            pass
        if is_new:
            path.unlink()
    except OSError as error:
        raise cannot_write(path, error) from error


def cannot_write(path: Path | str, error: OSError) -> SinkError:
    """Return the error for a file that cannot be written."""
    return SinkError(f"{path}: cannot be written ({error.strerror}); name another file or free the disk")
