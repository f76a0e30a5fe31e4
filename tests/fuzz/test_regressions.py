"""What once broke a parser does not again, good inputs are taken, and the attack finds what there is to find."""

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from tests.fuzz import __main__ as command
from tests.fuzz.hunt import alarmed, hunt, peak_mib, strict, tried
from tests.fuzz.mutation import CORPUS_BYTES, MAX_BYTES, Mutator
from tests.fuzz.targets import TARGETS, Opened, Take

REGRESSIONS = Path(__file__).with_name("regressions")
INPUTS = sorted(path.relative_to(REGRESSIONS) for path in REGRESSIONS.glob("*/*"))
MAX_REGRESSION_BYTES = 16_384
HUNT_S = 3.0


@pytest.mark.parametrize("name", TARGETS)
def test_the_inputs_that_others_are_made_of_are_taken(name: str, tmp_path: Path) -> None:
    with TARGETS[name].opened(tmp_path) as take, strict(), alarmed():
        assert all(tried(take, data) for data in TARGETS[name].seeds())


@pytest.mark.parametrize("path", INPUTS, ids=str)
def test_what_once_broke_a_parser_does_not_again(path: Path, tmp_path: Path) -> None:
    with TARGETS[path.parts[0]].opened(tmp_path) as take, strict(), alarmed():
        before_mib = peak_mib(afresh=True)
        assert tried(take, (REGRESSIONS / path).read_bytes())
        assert peak_mib() - before_mib < TARGETS[path.parts[0]].grows_mib


@pytest.mark.parametrize("path", INPUTS, ids=str)
def test_a_regression_is_small_and_belongs_to_a_parser(path: Path) -> None:
    assert path.parts[0] in TARGETS
    assert (REGRESSIONS / path).stat().st_size <= MAX_REGRESSION_BYTES


@contextmanager
def divides(_: Path) -> Iterator[Take]:
    """A parser that divides by zero where an input holds ``ff ff``."""
    yield lambda data: str(1 // int(b"\xff\xff" not in data))


@contextmanager
def grows(_: Path) -> Iterator[Take]:
    """A parser that keeps 64 MiB where an input holds "grow"."""
    kept = []

    def take(data: bytes) -> str:
        if b"grow" in data:
            kept.append(bytes(range(256)) * 4096 * 64)
        return "taken"

    yield take


@pytest.mark.parametrize(
    ("parser", "token", "found"),
    [(divides, b"\xff\xff", "ZeroDivisionError at "), (grows, b"grow", "memory grown by ")],
)
def test_a_mistake_is_found_and_its_input_kept_small(parser: Opened, token: bytes, found: str, tmp_path: Path) -> None:
    target = replace(TARGETS["speeds"], opened=parser, tokens=(token,), seeds=lambda: [bytes(range(200))], grows_mib=32)
    report = hunt(target, HUNT_S, 0, tmp_path / "findings", tmp_path / "current")
    ((what, where),) = report.findings.items()
    assert what.startswith(found)
    assert token in Path(where).read_bytes()
    assert parser is grows or Path(where).read_bytes() == token


@pytest.fixture
def mutator() -> Mutator:
    return Mutator([b"[camera]\nfps = 10\n"], (b"token",), 7)


def test_inputs_are_bounded_and_so_is_what_they_are_made_of(mutator: Mutator) -> None:
    for _ in range(2000):
        data = mutator.draw()
        assert len(data) <= MAX_BYTES
        mutator.keep(data + bytes(MAX_BYTES))
    assert mutator.size <= CORPUS_BYTES // MAX_BYTES + 1


def test_the_same_seed_draws_the_same_inputs(mutator: Mutator) -> None:
    again = Mutator([b"[camera]\nfps = 10\n"], (b"token",), 7)
    assert [mutator.draw() for _ in range(100)] == [again.draw() for _ in range(100)]


def test_the_command_attacks_the_parsers_that_are_named_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    options = ("--seconds", "0.3", "--engine", "mutation", "--findings", str(tmp_path / "findings"))
    monkeypatch.setattr(sys, "argv", ["fuzz", "speeds", "messages_of_ros", *options])
    assert command.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["speeds", "messages_of_ros"]
    assert all(int(line.split()[1]) > 10 for line in lines)
    assert not (tmp_path / "findings").exists()


def test_a_process_that_ends_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    ((what, where),) = command.hunted("speeds", 0.1, 0, tmp_path).items()
    assert what.startswith("the process ended with 1")
    assert Path(where).exists()
