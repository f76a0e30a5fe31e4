"""LSM9DS1: what is its own among the I2C chips."""

import struct
from collections.abc import Callable
from typing import Any

import pytest

RigMaker = Callable[..., Any]


def test_its_left_handed_axes_become_right_handed(rig: RigMaker) -> None:
    bench = rig("lsm9ds1", motion=lambda _: ((0.5, 0.25, -0.5), (3.0, 4.0, 9.0)))
    sample = bench.read_for(0.2)[-1]
    assert struct.unpack("<3h", bench.chip.registers[0x28:0x2E])[0] < 0
    assert sample.gyro == pytest.approx((0.5, 0.25, -0.5), abs=1e-3)
    assert sample.accel == pytest.approx((3.0, 4.0, 9.0), abs=2e-3)


def test_32_samples_are_kept_and_more_are_an_overflow(rig: RigMaker) -> None:
    bench = rig("lsm9ds1")
    bench.read_for(1)
    bench.clock.sleep_s(33 / 238)
    assert bench.device.read() == []
    assert bench.device.counts["fifo_overflow"] == 1
