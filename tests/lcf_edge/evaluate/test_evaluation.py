"""``lcf-edge evaluate`` as a user runs it: a corpus in, a folder with one report out."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import cv2
import msgspec
import pytest

from lcf_edge.cli.command_line import main
from lcf_edge.config import Config
from lcf_edge.errors import UsageError
from lcf_edge.evaluate import report
from lcf_edge.evaluate.one_recording import Task
from lcf_edge.evaluate.report import FrameLine
from lcf_edge.evaluate.workers import by_processes, interrupts_held

FRAMES = 18
INTERRUPTED = 130


def rows(folder: Path) -> dict[str, report.RecordingRow]:
    return {row.name: row for row in report.read(folder)[0].recordings}


class Links(HTMLParser):
    """What a page refers to."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.targets: set[str] = set()
        self.ids: set[str] = set()
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag != "script"
        self.targets |= {value for name, value in attrs if name in {"src", "href"} and value}
        self.ids |= {value for name, value in attrs if name == "id" and value}


def test_one_report_of_many_recordings_and_the_broken_one_is_left_out(
    corpus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["evaluate", str(corpus), "--out", str(out), "--jobs", "2"]) == 0
    output = capsys.readouterr()
    assert re.search(r"broken\.mcap: left out: .*broken\.mcap", output.err)
    assert "read      2 recordings, 1 left out" in output.out
    assert f"report    {out}/index.html" in output.out
    found = rows(out)
    assert found["broken.mcap"].error
    known, bare = found["with-truth"], found["without"]
    assert (known.has_truth, known.numbers.scored, known.numbers.due) == (True, FRAMES, FRAMES)
    assert (bare.has_truth, bare.numbers.scored, bare.numbers.due) == (False, FRAMES, 0)
    assert [threat.name for threat in known.threats] == ["bin"]
    assert known.numbers.median_ms is not None
    lines = (out / known.frames).read_bytes()
    frames = msgspec.json.Decoder(FrameLine).decode_lines(lines)
    assert sum(len(line.found) for line in frames) == known.numbers.found
    assert sum(line.false for line in frames) == known.numbers.false


def test_the_page_shows_every_image_and_refers_to_nothing_else(corpus: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["evaluate", str(corpus), "--out", str(out), "--jobs", "1"]) == 0
    links = Links((out / "index.html").read_text())
    shown = {image.file for row in rows(out).values() for image in row.pictures}
    assert shown
    assert {target for target in links.targets if not target.startswith("#")} == shown
    assert {target[1:] for target in links.targets if target.startswith("#")} <= links.ids
    assert all(cv2.imread(str(out / file)) is not None for file in shown)


def test_a_second_report_in_the_same_folder_leaves_nothing_of_the_first(corpus: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    for place in (corpus, corpus / "without"):
        assert main(["evaluate", str(place), "--out", str(out), "--jobs", "1"]) == 0
    (row,) = rows(out).values()
    there = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert there == {"index.html", "report.json", row.frames, *(image.file for image in row.pictures)}


def test_names_of_recordings_are_text_in_the_page(corpus: Path, tmp_path: Path) -> None:
    (corpus / "without").rename(corpus / "<script>alert(1)<{{RECORDINGS}}")
    (corpus / "broken.mcap").rename(corpus / os.fsdecode(b"\xff\x1b[31m.mcap"))
    assert main(["evaluate", str(corpus), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    page = (tmp_path / "out/index.html").read_text()
    Links(page)
    assert page.count('<section id="r1">') == 1
    assert "\x1b" not in page
    assert r"\udcff\x1b[31m.mcap" in rows(tmp_path / "out")


@pytest.mark.parametrize("frames", ["/dev/zero", "../../etc/passwd", "frames/0001.jsonl/../../x", "pictures"])
def test_a_report_of_others_names_no_file_outside_of_it(
    corpus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], frames: str
) -> None:
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    row = report.RecordingRow("with-truth", "x", frames=frames)
    told = report.Report(report.FORMAT, "1", "1", "now", "here", [], [row])
    (theirs / report.FILE).write_bytes(msgspec.json.encode(told))
    against = ["--against", str(theirs), "--out", str(tmp_path / "out")]
    assert main(["evaluate", str(corpus / "with-truth"), *against, "--jobs", "1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "is not a report's file of frames" in line


def test_frames_to_compare_with_are_a_file_of_bounded_size(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pipe, large = tmp_path / "0001.jsonl", tmp_path / "0002.jsonl"
    os.mkfifo(pipe)
    large.write_bytes(bytes(11))
    monkeypatch.setattr("lcf_edge.evaluate.one_recording.MAX_FRAMES_BYTES", 10)
    for before, told in ((pipe, "no file"), (large, "too large")):
        with pytest.raises(UsageError, match=told):
            Task("one", drive, Config(), before=before).frames_before()


def test_the_same_again_differs_in_no_frame_and_another_configuration_in_some(
    corpus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place, first = str(corpus / "with-truth"), tmp_path / "first"
    assert main(["evaluate", place, "--out", str(first), "--jobs", "1"]) == 0
    found = rows(first)["with-truth"].numbers.found
    assert found > 0
    again = ["evaluate", place, "--against", str(first), "--jobs", "1"]
    assert main([*again, "--out", str(tmp_path / "same")]) == 0
    assert rows(tmp_path / "same")["with-truth"].differing == 0
    capsys.readouterr()
    assert main([*again, "--out", str(tmp_path / "other"), "--set", "filter.corners_target=20"]) == 0
    row = rows(tmp_path / "other")["with-truth"]
    assert row.differing
    assert f"(was {found} of {FRAMES})" in capsys.readouterr().out
    page = (tmp_path / "other/index.html").read_text()
    assert "filter.corners_target=20" in page
    different = [image for image in row.pictures if image.why]
    assert different
    pair = cv2.imread(str(tmp_path / "other" / different[0].file))
    assert pair is not None
    assert pair.shape[1] > 2 * pair.shape[0]  # both, side by side


def test_truth_is_named_for_one_recording_or_as_a_folder_for_many(
    drive: Path, stamps_ns: list[int], tmp_path: Path, truth_of: Callable[[Path, list[int]], None]
) -> None:
    truth_of(tmp_path / "yard.jsonl", stamps_ns[:5])
    for given in (tmp_path / "yard.jsonl", tmp_path):
        out = tmp_path / "out" / given.name
        assert main(["evaluate", str(drive), "--truth", str(given), "--out", str(out), "--jobs", "1"]) == 0
        assert rows(out)["yard"].numbers.scored == 5


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        (["--against", "nowhere"], "nowhere: cannot be read"),
        (["--against", "corpus/with-truth/truth.jsonl"], "not a report of lcf-edge evaluate"),
        (["--truth", "corpus/with-truth/truth.jsonl"], "truth of one recording, and 3 are named"),
        (["--set", "vehicle.half_widht_m=1"], "half_width_m"),
        (["--jobs", "2", "--scheduler", "tcp://127.0.0.1:1"], "not allowed with"),
    ],
)
def test_wrong_usage_is_one_line_before_work_begins(
    corpus: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: list[str], output: str
) -> None:
    monkeypatch.chdir(corpus.parent)
    assert main(["evaluate", "corpus", *arguments]) == 2
    errors = capsys.readouterr().err
    assert len(errors.splitlines()) == 1
    assert output in errors
    assert not (corpus.parent / "evaluation").exists()


def test_a_corpus_of_which_nothing_can_be_read_fails(corpus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", str(corpus / "broken.mcap"), "--out", str(corpus / "out")]) == 1
    assert "not one of the recordings could be read" in capsys.readouterr().err


def test_the_report_compared_with_is_not_written_over(corpus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(corpus.parent / "out")
    place = str(corpus / "without")
    assert main(["evaluate", place, "--out", out, "--jobs", "1"]) == 0
    assert main(["evaluate", place, "--out", out, "--against", out]) == 2
    assert "name another folder with --out" in capsys.readouterr().err


class Fatal(type(Path())):  # type: ignore[misc]
    """A path that ends the process that it is handed to."""

    def __reduce__(self) -> tuple[Callable[[int], object], tuple[int]]:
        return os._exit, (3,)


def test_a_recording_that_ends_its_process_takes_no_other_with_it(drive: Path) -> None:
    good = [Task(f"good-{number}", drive, Config()) for number in range(5)]
    bad = Task("bad", Fatal(drive), Config())
    outcomes = {task.name: done for task, done in by_processes([*good[:1], bad, *good[1:]], 2)}
    assert set(outcomes) == {"bad", *(task.name for task in good)}
    failed = [name for name, done in outcomes.items() if isinstance(done, str)]
    assert failed == ["bad"]
    assert "its process ended" in str(outcomes["bad"])


def test_an_interrupt_that_another_thread_takes_waits_until_the_worker_has_started() -> None:
    holding, sent = threading.Event(), threading.Event()

    def interrupt() -> None:
        holding.wait()
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        sent.set()

    other = threading.Thread(target=interrupt)
    other.start()  # before the mask is set, which it would inherit
    steps = []

    def start() -> None:
        with interrupts_held():
            holding.set()
            sent.wait()
            other.join()  # here Python would run the handler
            steps.append("started")

    with pytest.raises(KeyboardInterrupt):
        start()
    assert steps == ["started"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_ends_it_without_a_traceback(corpus: Path, drive: Path, tmp_path: Path) -> None:
    for number in range(30):  # so that it cannot be through before it is interrupted
        (corpus / f"more-{number}").symlink_to(drive)
    command = (
        sys.executable,
        "-c",
        "import signal, os; os.setpgid(0, 0); from lcf_edge.cli.command_line import main; raise SystemExit(main())",
        "evaluate",
        str(corpus),
        "--out",
        str(tmp_path / "out"),
    )
    running = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    began = tmp_path / "out/index.html"
    while not began.exists():
        assert running.poll() is None
        time.sleep(0.01)
    os.killpg(running.pid, signal.SIGINT)
    _, errors = running.communicate(timeout=60)
    assert b"Traceback" not in errors
    assert running.returncode == INTERRUPTED
