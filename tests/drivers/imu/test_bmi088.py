"""BMI088: what is its own among the I2C chips, two sensors that know nothing of each other."""

from collections.abc import Callable
from typing import Any

import pytest

from drivers.errors import DeviceMissingError
from hil_mocks.i2c import bmi088

RigMaker = Callable[..., Any]


@pytest.mark.parametrize("clock_error", [-0.03, 0.0, 0.03])
def test_accelerations_are_of_the_gyros_time_though_the_clocks_differ(
    rig: RigMaker, clock_error: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bmi088, "ACCEL_RATE_ERROR", clock_error)
    bench = rig("bmi088")
    bench.read_for(20)
    for sample in bench.read_for(1):
        assert sample.accel == pytest.approx(bench.true(sample)[1], abs=0.03)  # 3 m/s² a second, over 10 ms


def test_the_accelerometer_is_found_at_its_other_address(rig: RigMaker) -> None:
    bench = rig("bmi088")
    bench.wire.chips[0x19] = bench.wire.chips.pop(0x18)
    assert bench.read_for(0.2)


def test_an_accelerometer_that_is_not_there_is_reported(rig: RigMaker) -> None:
    bench = rig("bmi088")
    del bench.wire.chips[0x18]
    with pytest.raises(DeviceMissingError, match=r"its accelerometer is neither at 0x18 nor at 0x19; check the wiring"):
        bench.open()


def test_an_accelerometer_that_reset_itself_is_seen(rig: RigMaker) -> None:
    bench = rig("bmi088")
    bench.read_for(1.2)
    bench.chip.accelerometer.power_up()
    bench.read_for(1)
    assert bench.device.counts["chip_reset"] == 1
    for sample in bench.read_for(0.5):
        assert sample.accel == pytest.approx(bench.true(sample)[1], abs=0.03)
