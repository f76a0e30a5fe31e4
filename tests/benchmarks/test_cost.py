"""What counting instructions makes of what valgrind and qemu say."""

import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.cost import CORES, FEW, MANY, PARTS, Cost, frames_run, of_a_frame, read_cachegrind, tables
from lcf_edge.compilation import uncompiled
from lcf_edge.errors import LcfError
from lcf_edge.rendered import scenes

CACHEGRIND = """\
==7157== I   refs:      2,430,454,096
==7157== I1  misses:       11,198,491
==7157== LLi misses:          601,183
==7157== I1  miss rate:          0.46%
==7157== D   refs:        874,220,056  (613,922,160 rd   + 260,297,896 wr)
==7157== D1  misses:       20,420,313  ( 16,905,900 rd   +   3,514,413 wr)
==7157== LLd misses:        4,190,550  (  2,904,531 rd   +   1,286,019 wr)
==7157== LL misses:         4,791,733  (  3,505,714 rd   +   1,286,019 wr)
"""


def test_cachegrind_counts_instructions_and_the_misses_of_the_first_and_the_last_cache() -> None:
    assert read_cachegrind(CACHEGRIND) == Cost(2_430_454_096, 11_198_491 + 20_420_313, 601_183 + 4_190_550)


def test_a_run_that_counted_nothing_is_reported_in_its_own_words() -> None:
    with pytest.raises(LcfError, match="No module named"):
        read_cachegrind("ModuleNotFoundError: No module named 'cv2'")


def test_what_every_run_does_once_is_no_cost_of_a_frame() -> None:
    def count(part: str, frames: int) -> Cost:
        assert part == "whole"
        return Cost(5e9 + 4e6 * frames, 1e6 + 100 * frames, 1e5 + 10 * frames)

    assert MANY > FEW
    assert of_a_frame(count, "whole") == Cost(4e6, 100, 10)


def test_an_estimate_reaches_from_all_misses_hidden_to_none() -> None:
    core = CORES[0]
    cost = Cost(1e6, 5000, 1000)
    least, most = core.ms(cost, 2e6)
    assert least == pytest.approx(2 / core.ipc / core.clock_ghz)
    assert most - least == pytest.approx((4000 * core.near_ns + 1000 * core.far_ns) / 1e6)


def test_valgrind_is_told_the_caches_of_the_core() -> None:
    assert CORES[0].options() == ["--I1=49152,3,64", "--D1=32768,2,64", "--LL=1048576,16,64"]


def test_without_a_count_of_64_bit_arm_the_estimate_takes_that_of_x86_64() -> None:
    counted = {core.name: {"whole": Cost(1e6)} for core in CORES}
    assert len(tables(counted, {})) == 2
    *_, estimate = tables(counted, {"whole": Cost(2e6)})
    *_, without = tables(counted, {})
    assert estimate.rows != without.rows


@pytest.mark.skipif(bool(uncompiled()), reason="what is counted is the compiled filter")
@pytest.mark.parametrize("part", PARTS)
def test_what_is_counted_runs_and_says_nothing(part: str, tmp_path: Path) -> None:
    drive = scenes.write(scenes.make("two_crossing", 1, seconds=0.2), tmp_path / "drive")
    command = [sys.executable, *frames_run(drive, part, 2)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
