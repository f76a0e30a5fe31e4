"""A machine of its own for each test: empty /dev, /sys and /proc in a folder, a clock that is turned by hand."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hil_mocks.virtual_clock import VirtualClock
from lcf_edge.config import Config
from lcf_edge.doctor.finding import Context

Machine = Callable[..., Context]


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def machine(tmp_path: Path, clock: VirtualClock) -> Machine:
    """A context on that machine; nobody listens at its port."""
    for folder in ("dev", "sys", "proc"):
        (tmp_path / folder).mkdir()

    def build(config: Config | None = None, **others: Any) -> Context:
        places = {folder: tmp_path / folder for folder in ("dev", "sys", "proc", "installed")}
        context = Context(config or Config(), **{"clock": clock, "program": "lcf-edge", **places, **others})
        context.__dict__["daemon"] = None  # as if asked already: nobody answered
        return context

    return build


@pytest.fixture
def process(tmp_path: Path) -> Callable[..., None]:
    """A process of that machine, with its command line and what it has open; None: not shown."""

    def run(pid: int, *words: str, opened: tuple[str, ...] = ()) -> None:
        folder = tmp_path / "proc" / str(pid)
        (folder / "fd").mkdir(parents=True)
        (folder / "cmdline").write_bytes("\0".join((*words, "")).encode())
        for number, target in enumerate(opened):
            (folder / "fd" / str(number)).symlink_to(target)

    return run


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, str], None]:
    """A file of that machine."""

    def write(name: str, text: str) -> None:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)

    return write
