"""Which recordings are found, what they are called, and what lies beside them."""

from pathlib import Path

import pytest

from lcf_edge.errors import RecordingError, UsageError
from lcf_edge.evaluate.corpus import find
from lcf_edge.evaluate.truth import read_truth


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


@pytest.mark.parametrize("content", [b'{"stamp_ns": 1, "objects": [{"name": "bin"}]}\n', b"\xff\xfe", b"{"])
def test_truth_that_is_none_names_its_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "truth.jsonl"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"truth\.jsonl"):
        read_truth(path)


def test_pictures_without_a_line_are_not_scored_and_without_a_file_nothing_is_there(tmp_path: Path) -> None:
    path = tmp_path / "truth.jsonl"
    path.write_text('{"stamp_ns": 7, "objects": []}\n')
    truth = read_truth(path)
    assert (truth.is_known, truth.of(7), truth.of(8)) == (True, [], None)
    assert (read_truth(None).is_known, read_truth(None).of(8)) == (False, ())
