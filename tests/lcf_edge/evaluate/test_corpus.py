"""Which recordings are found, what they are called, and what lies beside them."""

import os
from pathlib import Path

import numpy as np
import pytest

from lcf_edge.errors import RecordingError, UsageError
from lcf_edge.evaluate.corpus import find
from lcf_edge.evaluate.drawings import MAX_HEIGHT_PX, draw
from lcf_edge.evaluate.truth import MAX_KNOWN, MAX_LINE_BYTES, MAX_NAME, MAX_PX, read_truth


def test_a_folder_stands_for_all_recordings_below_it(corpus: Path) -> None:
    assert [entry.name for entry in find([corpus])] == ["broken.mcap", "with-truth", "without"]
    (corpus / "metadata.yaml").touch()
    assert [entry.name for entry in find([corpus])] == ["corpus"]  # a bag of one file


def test_settings_and_truth_lie_in_a_folder_or_beside_a_file(corpus: Path) -> None:
    for name in ("broken.settings", "broken.truth.jsonl"):
        (corpus / name).write_text("camera.fps=5")
    broken, folder, bare = find([corpus])
    assert (broken.settings, broken.truth) == (["camera.fps=5"], corpus / "broken.truth.jsonl")
    assert (len(folder.settings), folder.truth) == (2, corpus / "with-truth/truth.jsonl")
    assert bare.truth is None


def test_a_recording_named_by_its_mav0_is_the_same_recording(corpus: Path, drive: Path) -> None:
    (named,) = find([drive / "mav0"])
    assert named.name == "yard"
    assert [entry.name for entry in find([corpus / "without", corpus / "without"])] == ["without"]


def test_names_are_as_long_as_tells_them_apart(tmp_path: Path) -> None:
    for name in ("mon/drive.mp4", "tue/drive.mp4", "tue/other.mp4"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert [entry.name for entry in find([tmp_path])] == ["mon/drive.mp4", "tue/drive.mp4", "other.mp4"]


def test_a_folder_without_recordings_is_wrong_usage(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no recording in it"):
        find([tmp_path])


def a_thing(box: str = "[0, 0, 20, 20]", name: str = "bin") -> bytes:
    return f'{{"stamp_ns": 1, "objects": [{{"name": "{name}", "box": {box}}}]}}\n'.encode()


def test_names_that_are_no_text_or_would_be_obeyed_are_shown_as_codes(tmp_path: Path) -> None:
    for name in (b"a\xff.mp4", b"a\x1b[31m.mp4"):
        (tmp_path / os.fsdecode(name)).touch()
    assert sorted(entry.name for entry in find([tmp_path])) == [r"a\udcff.mp4", r"a\x1b[31m.mp4"]


@pytest.mark.parametrize(
    "content",
    [
        b'{"stamp_ns": 1, "objects": [{"name": "bin"}]}\n',
        b"\xff\xfe",
        b"{",
        a_thing("[0, 0, 1e308, 1e308]"),
        a_thing("[0, 0, 1e999, 1]"),
        a_thing(name="x" * (MAX_NAME + 1)),
        b" " * MAX_LINE_BYTES,
    ],
    ids=lambda content: str(content[-30:]),
)
def test_truth_that_is_none_names_its_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "truth.jsonl"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"truth\.jsonl"):
        read_truth(path)


def test_truth_that_would_fill_the_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lcf_edge.evaluate.truth.MAX_KNOWN", 100)
    path = tmp_path / "truth.jsonl"
    path.write_bytes(a_thing() * 50)
    assert read_truth(path).of(1)
    path.write_bytes(a_thing() * 51)
    with pytest.raises(RecordingError, match="more than 100"):
        read_truth(path)


def test_the_bounds_of_truth_are_those_of_the_document() -> None:
    document = " ".join((Path(__file__).parents[3] / "docs/evaluate.md").read_text(encoding="utf-8").split())
    assert f"at most {MAX_NAME} characters, a box lies within {MAX_PX:,.0f} px" in document
    assert MAX_LINE_BYTES == 2**20
    assert f"less than 1 MiB, and there are at most {MAX_KNOWN:,} images and things" in document


def test_a_high_and_narrow_image_is_drawn_small() -> None:
    drawn = draw(np.zeros((60_000, 2), np.uint8), [], [], "1")
    assert drawn.shape[0] == MAX_HEIGHT_PX


def test_images_without_a_line_are_not_scored_and_without_a_file_nothing_is_there(tmp_path: Path) -> None:
    path = tmp_path / "truth.jsonl"
    path.write_text('{"stamp_ns": 7, "objects": []}\n')
    truth = read_truth(path)
    assert (truth.is_known, truth.of(7), truth.of(8)) == (True, [], None)
    assert (read_truth(None).is_known, read_truth(None).of(8)) == (False, ())
