"""ICM-20602: what is its own among the I2C chips."""

from collections.abc import Callable
from typing import Any

import pytest

RigMaker = Callable[..., Any]


def test_an_offset_that_the_chip_has_changed_by_itself_is_given_back(rig: RigMaker) -> None:
    bench = rig("icm20602", motion=lambda _: ((0.1, 0.2, 0.3), (0.0, 1.0, 9.8)))
    bench.read_for(1)
    bench.chip.registers[0x7A] = 0x0D  # about 2.5 m/s²
    bench.read_for(1)
    assert bench.device.counts["chip_reset"] == 1
    assert all(sample.accel == pytest.approx((0.0, 1.0, 9.8), abs=0.01) for sample in bench.read_for(1))


def test_it_is_given_back_also_if_a_reset_leaves_it(rig: RigMaker) -> None:
    bench = rig("icm20602", motion=lambda _: ((0.1, 0.2, 0.3), (0.0, 1.0, 9.8)))
    bench.read_for(1)
    right = bench.chip.power_on
    bench.chip.power_on = {**right, 0x7A: 0x0D}
    bench.chip.registers[0x7A] = 0x0D
    bench.read_for(1)
    assert bench.chip.registers[0x7A] == right[0x7A]
    assert bench.device.counts["chip_reset"] == 1
