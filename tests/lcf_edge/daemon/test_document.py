"""docs/operation.md describes what the daemon does; each row of its table of what may be missing has a test."""

import re
from pathlib import Path
from typing import Any

import pytest

from lcf_edge.config import Config, Record
from lcf_edge.daemon.clock import SystemTime
from lcf_edge.daemon.outputs import Outputs
from lcf_edge.daemon.reload import OTHER_KEYS, PIPELINE_KEYS
from lcf_edge.daemon.sinks import sinks

HERE = Path(__file__).parent
DOCUMENT = (HERE.parents[2] / "docs/operation.md").read_text(encoding="utf-8")

TESTS = {
    "no camera": "test_without_a_camera_it_lives_and_says_since_when",
    "camera silent": "test_a_camera_that_falls_silent_is_stale",
    "dark lens": "test_a_dark_or_covered_lens_is_reported_after_half_a_second_and_until_it_sees",
    "covered lens": "test_a_dark_or_covered_lens_is_reported_after_half_a_second_and_until_it_sees",
    "glare, blur, few corners": "test_what_degrades_a_scene_is_reported",
    "rolling shutter": "test_a_rolling_shutter_is_told_with_its_readout_time",
    "glossy floor": "test_what_degrades_a_scene_is_reported",
    "drops or dirt on the lens": "test_what_degrades_a_scene_is_reported",
    "frame rate too low for the motion": "test_a_frame_rate_too_low_for_the_motion",
    "no IMU": "test_an_imu_that_is_away_widens_and_is_reported",
    "gyro's bias not known yet": "test_a_gyro_that_is_not_fully_believed_says_why",
    "gyro for yaw alone": "test_what_degrades_a_scene_is_reported",
    "motion beyond the IMU's range": "test_what_degrades_a_scene_is_reported",
    "gyro repeats one value (a chip or bus that hangs)": "test_a_gyro_that_is_not_fully_believed_says_why",
    "no speed": "test_without_speed_ranges_are_unknown",
    "pipeline too slow": "test_every_frame_is_a_scene_or_counted",
    "pipeline stuck": "test_the_watchdog_is_fed_by_the_progress_of_the_pipeline",
    "system clock set": "test_stamps_follow_a_step_of_the_system_clock_and_it_is_reported",
    "disk full, or gone": "test_a_disk_that_takes_nothing_costs_the_recording_only",
    "memory short": "test_over_the_mark_it_gives_up_the_preview_then_corners_and_says_so",
    "file descriptors used up by connections": "test_without_descriptors_it_lives_reports_and_reads_its_configuration",
    "board hot": "test_a_board_that_is_hot_is_reported",
}


def section(heading: str) -> str:
    return DOCUMENT.split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]


def cells(heading: str) -> list[list[str]]:
    lines = [line for line in section(heading).splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_each_row_has_a_test() -> None:
    assert [row[0] for row in cells("When something is missing")] == list(TESTS)
    sources = "\n".join(path.read_text(encoding="utf-8") for path in HERE.glob("test_*.py"))
    assert {name for name in TESTS.values() if f"def {name}(" not in sources} == set()


def test_what_is_given_up_has_its_order(link: Any) -> None:
    outputs = Outputs(sinks(Config(record=Record(when="always")), link, SystemTime()))
    given_up = [shedding.name for shedding in outputs.sheddings()]
    assert re.findall(r"^\d\. (.+)$", section("Memory"), re.M) == [*given_up, "half of the corners"]


@pytest.mark.parametrize(("row", "tables"), [(0, PIPELINE_KEYS), (1, OTHER_KEYS)])
def test_the_keys_of_a_reload_are_those(row: int, tables: dict[str, frozenset[str]]) -> None:
    listed: dict[str, set[str]] = {}
    for part in cells("Reload")[row][0].split("; "):
        for clause in re.findall(r"((?:all|`\w+`(?:, `\w+`)*)) of `(\w+)`(?: but `(\w+)`)?", part):
            names, table, but = clause
            listed[table] = {"all", *([f"-{but}"] if but else [])} if names == "all" else set(re.findall(r"\w+", names))
    for table, keys in tables.items():
        assert listed.pop(table) in ({"all"}, {"all", "-budget_mib"}, keys), table
    assert not listed
