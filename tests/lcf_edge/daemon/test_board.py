"""Temperature and throttling, from a tree like the kernel's."""

from pathlib import Path

import pytest

from lcf_edge.daemon.board import Board, read_board


def write(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"{text}\n")
    return root


def test_the_hottest_zone_counts(tmp_path: Path) -> None:
    zones = {f"class/thermal/thermal_zone{i}/temp": text for i, text in enumerate(("45123", "61500", "", "warm"))}
    assert read_board(write(tmp_path, zones)) == Board(61.5, ())


def test_a_processor_that_is_being_cooled_is_slowed(tmp_path: Path) -> None:
    files = {
        "class/thermal/cooling_device0/type": "cpufreq-cpu0",
        "class/thermal/cooling_device0/cur_state": "2",
        "class/thermal/cooling_device1/type": "pwm-fan",
        "class/thermal/cooling_device1/cur_state": "3",
        "class/thermal/cooling_device2/type": "Processor",
        "class/thermal/cooling_device2/cur_state": "0",
    }
    assert read_board(write(tmp_path, files)).slowed == ("cpufreq-cpu0",)


@pytest.mark.parametrize(
    ("bits", "slowed"),
    [("0", ()), ("5", ("under-voltage", "throttled")), ("50000", ()), ("d0008", ("soft temperature limit",))],
)
def test_the_firmware_of_a_raspberry_pi_reports_more(tmp_path: Path, bits: str, slowed: tuple[str, ...]) -> None:
    tree = write(tmp_path, {"devices/platform/soc/soc:firmware/get_throttled": bits})
    assert read_board(tree).slowed == slowed


def test_a_board_that_reports_nothing(tmp_path: Path) -> None:
    assert read_board(tmp_path) == Board(None, ())
