"""What once broke a parser does not again, good inputs are taken, and the attack finds what there is to find."""

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.fuzz import __main__ as command
from tests.fuzz.hunt import alarmed, hunt, peak_mib, strict, tried
from tests.fuzz.mutation import CORPUS_BYTES, MAX_BYTES, Mutator
from tests.fuzz.targets import TARGETS, Take

REGRESSIONS = Path(__file__).with_name("regressions")
INPUTS = sorted(path.relative_to(REGRESSIONS) for path in REGRESSIONS.glob("*/*"))
MAX_REGRESSION_BYTES = 16_384


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


class Planted:
    """A parser with one mistake, made where an input holds `token`."""

    token: bytes

    def __init__(self, folder: Path) -> None:
        del folder

    def __enter__(self) -> Take:
        self.kept = [b""]
        return self._take

    def __exit__(self, *_: object) -> None:
        self.kept.clear()

    def _take(self, data: bytes) -> str:
        if self.token in data:
            self._err()
        return "taken"

    def _err(self) -> None:
        raise NotImplementedError


class Divides(Planted):
    token = b"\xff\xff"

    def _err(self) -> None:
        self.kept.append(bytes(1 // len(self.kept[0])))


class Grows(Planted):
    token = b"grow"

    def _err(self) -> None:
        self.kept.append(bytes(range(256)) * 4096 * 64)


@pytest.mark.parametrize(("parser", "found"), [(Divides, "ZeroDivisionError at "), (Grows, "memory grown by ")])
def test_a_mistake_is_found_and_its_input_kept_small(parser: type[Planted], found: str, tmp_path: Path) -> None:
    target = replace(
        TARGETS["speeds"], opened=parser, tokens=(parser.token,), seeds=lambda: [bytes(range(200))], grows_mib=32
    )
    report = hunt(target, 1.0, 0, tmp_path / "findings", tmp_path / "current")
    ((what, where),) = report.findings.items()
    assert what.startswith(found)
    assert parser.token in Path(where).read_bytes()
    assert parser is Grows or Path(where).read_bytes() == parser.token


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
