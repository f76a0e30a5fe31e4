"""The budget is checked at the start, watched, and kept by giving things up in order."""

import os
from pathlib import Path
from typing import Literal

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Camera, Config, Memory, Record
from lcf_edge.daemon.memory import SHED_AT, MemoryWatch, ResidentMemory, Shedding, check_budget, needs_mib
from lcf_edge.errors import ConfigError


def test_resident_memory_is_what_the_kernel_says() -> None:
    kilobytes = next(
        int(line.split()[1]) for line in Path("/proc/self/status").read_text().splitlines() if "VmRSS" in line
    )
    assert ResidentMemory()() == pytest.approx(kilobytes / 1024, rel=0.1)


def test_a_table_of_statm_is_read_in_pages(tmp_path: Path) -> None:
    (tmp_path / "statm").write_text("9999 512 3 4 5 6 7\n")
    assert ResidentMemory(tmp_path / "statm")() == 512 * os.sysconf("SC_PAGE_SIZE") / 2**20


@pytest.mark.parametrize("when", ["never", "always", "threat"])
def test_the_default_fits_its_budget(when: Literal["never", "always", "threat"]) -> None:
    check_budget(Config(record=Record(when=when)))


@pytest.mark.parametrize(
    ("config", "remedy"),
    [
        (Config(camera=Camera(width=1920, height=1080)), "lower camera.width and camera.height"),
        (Config(memory=Memory(corners=32767, edges_normal=32767)), "lower the other keys of memory"),
        (Config(memory=Memory(budget_mib=40)), "raise it to "),
        (Config(record=Record(when="threat", buffer_mib=20)), "lower record.buffer_mib, or raise it to "),
    ],
)
def test_a_budget_that_cannot_be_kept_is_refused_with_what_to_lower(config: Config, remedy: str) -> None:
    with pytest.raises(ConfigError, match=r"^memory\.budget_mib: ") as refused:
        check_budget(config)
    assert remedy in str(refused.value)


@pytest.mark.parametrize(
    "config", [Config(camera=Camera(width=1920, height=1080)), Config(memory=Memory(budget_mib=2))]
)
def test_what_it_says_to_raise_it_to_is_enough(config: Config) -> None:
    with pytest.raises(ConfigError) as refused:
        check_budget(config)
    wanted_mib = float(str(refused.value).rpartition("raise it to ")[2])
    assert wanted_mib * SHED_AT >= sum(needs_mib(config).values())
    check_budget(msgspec.structs.replace(config, memory=Memory(budget_mib=wanted_mib)))


def test_shedding_keeps_its_order_and_takes_one_at_a_time() -> None:
    resident = 50.0
    given_up: list[str] = []
    order = [Shedding(name, lambda name=name: given_up.append(name)) for name in ("preview", "corners")]  # type: ignore[misc]
    watch = MemoryWatch(100.0, order, lambda: resident)
    watch.check()
    assert given_up == []
    resident = 90.1
    watch.check()
    assert given_up == ["preview"] == watch.shed
    resident = 89.0  # that was enough
    watch.check()
    assert given_up == ["preview"]
    resident = 91.0  # it only wavers
    watch.check()
    assert given_up == ["preview"]
    resident = 95.0
    watch.check()
    watch.check()  # nothing is left
    assert given_up == ["preview", "corners"] == watch.shed
    assert watch.resident_mib == 95.0


@given(st.lists(st.floats(0, 200), max_size=30))
def test_nothing_is_given_up_below_the_mark_nor_twice(course_mib: list[float]) -> None:
    given_up: list[int] = []
    order = [Shedding(str(i), lambda i=i: given_up.append(i)) for i in range(3)]  # type: ignore[misc]
    readings = iter([0.0, *course_mib])
    watch = MemoryWatch(100.0, order, lambda: next(readings))
    for _ in course_mib:
        watch.check()
    assert given_up == list(range(len(given_up)))
    assert len(given_up) >= min(3, sum(mib > 100.0 for mib in course_mib))
    assert bool(given_up) == any(mib > 90.0 for mib in course_mib)
    assert len(given_up) <= sum(mib > 90.0 for mib in course_mib)
