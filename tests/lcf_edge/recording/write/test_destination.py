"""Names of files, and the room that they may take."""

from pathlib import Path

import pytest

from lcf_edge.config import Record
from lcf_edge.recording.read.rosbag import bag_files
from lcf_edge.recording.write.destination import MIB, Folder, Named

NOW_NS = 1_795_268_460_000_000_000  # 2026-11-21 13:41:00


def filled(path: Path, mib: float) -> Path:
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as file:
        file.truncate(round(mib * MIB))
    return path


def test_files_are_numbered_and_show_when_they_began(tmp_path: Path) -> None:
    folder = Folder(Record(folder=str(tmp_path / "made" / "for us")))
    first = folder.next(NOW_NS)
    assert first == tmp_path / "made" / "for us" / "lcf-edge-000001-20261121T134100Z.mcap"
    first.touch()
    assert folder.next(0).name == "lcf-edge-000002-19700101T000000Z.mcap"  # the clock was set back


def test_the_oldest_of_ours_give_way_and_no_others(tmp_path: Path) -> None:
    folder = Folder(Record(folder=str(tmp_path), file_mib=10, total_mib=40))
    ours = [filled(tmp_path / f"lcf-edge-{number:06}-20261121T134100Z.mcap", 9) for number in range(8, 13)]
    others = [filled(tmp_path / name, 100) for name in ("drive.mcap", "lcf-edge-7.mcap", "notes.txt")]
    path = folder.next(NOW_NS)
    assert [file.exists() for file in ours] == [False, False, True, True, True]
    assert all(file.exists() for file in others)
    assert folder.removed == 2
    assert path.name.startswith("lcf-edge-000013-")


def test_links_and_folders_with_such_a_name_are_not_ours(tmp_path: Path) -> None:
    elsewhere = filled(tmp_path / "elsewhere", 100)
    ours = filled(tmp_path / "ours" / "lcf-edge-000004-20261121T134100Z.mcap", 1)
    names = [ours.with_name(f"lcf-edge-{number:06}-20261121T134100Z.mcap") for number in range(1, 4)]
    names[0].symlink_to(elsewhere)
    names[1].symlink_to(tmp_path / "nowhere")
    names[2].mkdir()
    folder = Folder(Record(folder=str(ours.parent), file_mib=10, total_mib=10))
    assert folder.next(NOW_NS).name.startswith("lcf-edge-000005-")
    assert folder.removed == 1
    assert sorted(ours.parent.iterdir()) == names
    assert elsewhere.exists()


def test_after_the_largest_number_of_18_digits_numbers_and_pruning_go_on(tmp_path: Path) -> None:
    folder = Folder(Record(folder=str(tmp_path), file_mib=10, total_mib=20))
    paths = [filled(tmp_path / f"lcf-edge-{'9' * 18}-20261121T134100Z.mcap", 9)]
    paths += [filled(folder.next(NOW_NS), 9) for _ in range(3)]
    assert [path.name.split("-")[2] for path in paths[1:]] == [str(10**18 + n) for n in range(3)]
    assert [path.exists() for path in paths] == [False, False, True, True]


def test_two_of_the_same_number_count_both(tmp_path: Path) -> None:
    ours = [filled(tmp_path / f"lcf-edge-000001-{year}1121T134100Z.mcap", 9) for year in (2025, 2026)]
    Folder(Record(folder=str(tmp_path), file_mib=10, total_mib=20)).next(NOW_NS)
    assert [file.exists() for file in ours] == [False, True]


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file"):
        Folder(Record(folder=str(tmp_path / "file" / "folder"))).next(NOW_NS)


def test_a_name_is_kept_and_nothing_is_overwritten(tmp_path: Path) -> None:
    named = Named(tmp_path / "drive.mcap")
    paths = []
    for _ in range(3):
        paths.append(named.next(NOW_NS))
        paths[-1].touch()
    assert [path.name for path in paths] == ["drive.mcap", "drive_2.mcap", "drive_3.mcap"]
    assert bag_files(tmp_path) == paths  # a replay of the folder takes them in this order
