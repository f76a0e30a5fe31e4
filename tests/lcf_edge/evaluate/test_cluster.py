"""A corpus on a Dask cluster: a scheduler and two workers, each a process of its own."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from distributed import Client

from lcf_edge import __version__
from lcf_edge.cli.command_line import main
from lcf_edge.config import Config
from lcf_edge.errors import LcfError
from lcf_edge.evaluate import report
from lcf_edge.evaluate.one_recording import Done, Task
from lcf_edge.evaluate.workers import by_cluster, by_processes

PATIENCE_S = 60
RECORDINGS = 8


@dataclass
class Cluster:
    """Its processes."""

    endpoint: str
    processes: ExitStack
    folder: Path
    workers: list["subprocess.Popen[bytes]"] = field(default_factory=list)

    def start_worker(self) -> None:
        place = str(self.folder / f"worker-{len(self.workers)}")
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1", "--local-directory", place)
        self.workers.append(self.processes.enter_context(process("worker", self.endpoint, *options)))
        with Client(self.endpoint, set_as_default=False) as client:
            client.wait_for_workers(len(self.workers), timeout=PATIENCE_S)


class process:  # noqa: N801
    """One of Dask's programs, ended at the end of the block."""

    def __init__(self, *arguments: str) -> None:
        command = (sys.executable, "-m", "dask", *arguments)
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

    def __enter__(self) -> "subprocess.Popen[bytes]":
        return self._process

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[Cluster]:
    with ExitStack() as stack:
        running = stack.enter_context(process("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"))
        assert running.stderr is not None
        said = (re.search(rb"Scheduler at:\s+(tcp://\S+)", line) for line in running.stderr)
        yield Cluster(next(match[1].decode() for match in said if match), stack, tmp_path)


@pytest.fixture
def cluster(scheduler: Cluster) -> Cluster:
    scheduler.start_worker()
    scheduler.start_worker()
    return scheduler


def quiet(text: str) -> None:
    pytest.fail(text)


def test_when_a_worker_is_killed_in_the_middle_the_other_does_its_part(cluster: Cluster, drive: Path) -> None:
    tasks = [Task(f"drive-{number}", drive, Config()) for number in range(RECORDINGS)]
    outcomes = {}
    for task, done in by_cluster(tasks, cluster.endpoint, quiet):
        if not outcomes:
            cluster.workers[0].kill()
        outcomes[task.name] = done
    ((_, here),) = by_processes(tasks[:1], 1)
    assert isinstance(here, Done)
    assert set(outcomes) == {task.name for task in tasks}
    assert all(isinstance(done, Done) and done.frames == here.frames for done in outcomes.values())


def test_so_it_does_when_one_is_killed_at_the_beginning(
    monkeypatch: pytest.MonkeyPatch, cluster: Cluster, drive: Path, tmp_path: Path
) -> None:
    """While the workers are asked for their version."""
    mark = tmp_path / "killed"

    def version() -> str:
        with suppress(FileExistsError):
            mark.touch(exist_ok=False)
            os.kill(os.getpid(), signal.SIGKILL)
        return __version__

    monkeypatch.setattr("lcf_edge.evaluate.workers._version", version)
    ((_, done),) = by_cluster([Task("drive", drive, Config())], cluster.endpoint, quiet)
    assert isinstance(done, Done)
    assert mark.exists()


def test_the_command_writes_the_same_report_as_without_a_cluster(
    cluster: Cluster, corpus: Path, tmp_path: Path
) -> None:
    for name, options in (("here", ["--jobs", "1"]), ("there", ["--scheduler", cluster.endpoint])):
        assert main(["evaluate", str(corpus), "--out", str(tmp_path / name), *options]) == 0
    here, there = (report.read(tmp_path / name)[0].recordings for name in ("here", "there"))
    assert [(row.name, row.numbers.found, row.error) for row in here] == [
        (row.name, row.numbers.found, row.error) for row in there
    ]


def test_a_scheduler_without_workers_is_refused(scheduler: Cluster, drive: Path) -> None:
    with pytest.raises(LcfError, match="no workers; start one: dask worker tcp://"):
        list(by_cluster([Task("drive", drive, Config())], scheduler.endpoint, quiet))


def test_workers_of_another_version_are_refused(monkeypatch: pytest.MonkeyPatch, cluster: Cluster, drive: Path) -> None:
    monkeypatch.setattr("lcf_edge.evaluate.workers.__version__", "0.0.0")
    with pytest.raises(LcfError, match=r"lcf-edge \S+ there, 0\.0\.0 here; install the same version on all workers"):
        list(by_cluster([Task("drive", drive, Config())], cluster.endpoint, quiet))


@pytest.mark.parametrize("endpoint", ["tcp://127.0.0.1:1", "nonsense"])
def test_no_scheduler_is_one_line(
    monkeypatch: pytest.MonkeyPatch, drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], endpoint: str
) -> None:
    monkeypatch.setattr("lcf_edge.evaluate.workers.PATIENCE_S", 0.5)
    assert main(["evaluate", str(drive), "--scheduler", endpoint, "--out", str(tmp_path / "out")]) == 1
    assert f"{endpoint}: no Dask scheduler there" in capsys.readouterr().err
