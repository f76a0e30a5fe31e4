"""The samples in the repository: small, readable by our own reader and by others', and true."""

from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from lcf_edge.config import load
from lcf_edge.evaluate.one_recording import Done, Task, evaluate
from lcf_edge.evaluate.truth import read_truth
from lcf_edge.rendered import scenes
from release import samples

MAX_BYTES = 2_000_000
NAMES = sorted(samples.drives())


@pytest.fixture(scope="module", params=NAMES)
def sample(request: pytest.FixtureRequest) -> Path:
    return samples.FOLDER / f"{request.param}.mcap"


def test_each_is_there_and_small(sample: Path) -> None:
    assert sorted(path.stem for path in samples.FOLDER.glob("*.mcap")) == NAMES
    assert sample.stat().st_size < MAX_BYTES


def test_the_truth_beside_it_is_that_of_the_renderer(sample: Path) -> None:
    lines = [msgspec.json.decode(line) for line in sample.with_suffix(".truth.jsonl").read_bytes().splitlines()]
    truths = list(scenes.truths(samples.drives()[sample.stem]))
    assert [line["stamp_ns"] for line in lines] == [truth.stamp_ns for truth in truths]
    for line, truth in zip(lines, truths, strict=True):
        assert {each["name"]: each["threat"] for each in line["objects"]} == {
            each.name: each.target for each in truth.objects if each.in_sight
        }


def test_every_image_of_it_has_truth_and_the_filter_sees_what_threatens(sample: Path) -> None:
    truth = read_truth(sample.with_suffix(".truth.jsonl"))
    assert truth.is_known
    done = evaluate(Task(sample.stem, sample, load(sample), truth=sample.with_suffix(".truth.jsonl")))
    assert isinstance(done, Done)
    assert not done.row.error
    numbers = done.row.numbers
    assert numbers.scored == numbers.pictures
    assert (numbers.due > 0) == (sample.stem == "walkers")
    assert numbers.found >= numbers.due / 2
    assert numbers.contacts == 0


def test_another_reader_finds_sensors_and_what_was_reported(sample: Path) -> None:
    with sample.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = {
        summary.channels[number].topic: count for number, count in summary.statistics.channel_message_counts.items()
    }
    frames = counts["/lcf/camera/image_raw/compressed"]
    assert counts["/lcf/scene"] == counts["/lcf/annotations"] == frames > 0
    assert counts["/lcf/imu"] > 10 * frames
    assert counts["/lcf/speed"] > 3 * frames


def test_one_can_be_written_again(tmp_path: Path) -> None:
    drive = scenes.make("two_crossing", 1, seconds=0.3, width=160, height=120, focal_px=125.0)
    samples.write(drive, tmp_path / "short.mcap")
    assert load(tmp_path / "short.mcap").camera.width == 160
    assert len((tmp_path / "short.truth.jsonl").read_text().splitlines()) == round(0.3 * drive.fps)
