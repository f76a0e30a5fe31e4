"""ICM-42688-P: what is its own among the I2C chips."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from drivers.imu.settings import ImuSettings

RigMaker = Callable[..., Any]


def test_packets_without_data_are_left_out(rig: RigMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil_mocks.i2c.icm42688.START_UP_NS", 150_000_000)  # longer than it should
    bench = rig("icm42688", motion=lambda _: ((0.1, 0.2, 0.3), (0.0, 0.0, 9.8)))
    samples = bench.read_for(0.5)
    assert bench.device.counts["no_data"] >= 1
    assert all(sample.gyro == pytest.approx((0.1, 0.2, 0.3), abs=math.radians(1 / 65.5)) for sample in samples)


@pytest.mark.parametrize("identity", [0x40, 0x41, 0x42, 0x46, 0x47])
def test_its_family_is_known(rig: RigMaker, identity: int) -> None:
    bench = rig("icm42688")
    bench.chip.power_on = {**bench.chip.power_on, 0x75: identity}
    bench.chip.power_up()
    for sample in bench.read_for(0.5):
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.01)


def test_another_bank_that_a_program_left_selected_does_not_hide_it(rig: RigMaker) -> None:
    bench = rig("icm42688")
    bench.chip.registers[0x76] = 1
    assert bench.read_for(0.3)


def test_the_gyro_does_not_stall_where_it_would_change_its_range_by_itself(rig: RigMaker) -> None:
    """AFSR: at 100 °/s it would repeat a value for 2 ms."""
    turning = rig(
        "icm42688",
        motion=lambda t: ((0.0, 0.0, 4 * math.sin(20 * t)), (0.0, 0.0, 9.8)),
        settings=ImuSettings(rate_hz=1000.0, gyro_range_dps=500),
    )
    samples = [sample.gyro[2] for sample in turning.read_for(1.5)]
    assert max(samples) > math.radians(200)
    near = [(a, b) for a, b in pairwise(samples) if abs(a) < 3]
    assert min(abs(b - a) for a, b in near) > 0.02
    assert turning.chip.registers[0x4D] == 0x51  # nothing else in the register has changed
