"""BNO055: what bus masters that do not wait for a stretched clock make of its bytes."""

import math
from collections.abc import Callable
from typing import Any

import pytest

ACC_DATA = 0x08
RigMaker = Callable[..., Any]


@pytest.mark.parametrize("at", [0, 1, 5, 12, 13, 17])
def test_a_flipped_top_bit_is_refused_and_the_sample_read_again(rig: RigMaker, at: int) -> None:
    bench = rig("bno055")
    bench.read_for(0.5)
    bench.wire.flip(at, register=ACC_DATA)
    samples = bench.read_for(0.5)
    assert bench.device.counts["implausible"] == 1
    assert len(samples) == pytest.approx(50, abs=1)
    for sample in samples:
        gyro, accel = bench.true(sample)
        assert sample.gyro == pytest.approx(gyro, abs=0.02)
        assert sample.accel == pytest.approx(accel, abs=0.05)


def test_flips_that_go_on_are_refused_as_long(rig: RigMaker) -> None:
    bench = rig("bno055")
    bench.read_for(0.5)
    for at in (1, 3, 17, 13, 15, 5):
        bench.wire.flip(at, register=ACC_DATA)
    samples = bench.read_for(0.5)
    assert bench.device.counts["implausible"] >= 4
    assert max(abs(value) for sample in samples for value in sample.gyro) < 1
    assert len(samples) >= 47


def test_a_flip_in_the_very_first_read_is_refused(rig: RigMaker) -> None:
    bench = rig("bno055")
    bench.wire.flip(13, register=ACC_DATA)
    assert max(abs(value) for sample in bench.read_for(0.2) for value in sample.gyro) < 1


def test_a_jump_that_is_real_is_believed(rig: RigMaker) -> None:
    def bump(t: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return (3.0 if t > 1.5 else 0.0, 0.0, 0.0), (0.0, 0.0, 9.8)

    bench = rig("bno055", motion=bump)
    samples = bench.read_for(1.5)
    assert samples[0].gyro[0] == 0
    assert samples[-1].gyro[0] == pytest.approx(3.0, abs=0.001)
    jumped = next(sample for sample in samples if sample.gyro[0])
    assert jumped.stamp_ns - bench.began_ns == pytest.approx(1.5e9, abs=15e6)
    assert not bench.device.counts["implausible"]


def test_after_a_late_poll_the_stamps_are_right(rig: RigMaker) -> None:
    bench = rig("bno055")
    bench.read_for(1)
    for late_s in (0.025, 0.045, 0.085):
        bench.clock.sleep_s(late_s)
        for sample in bench.read_for(0.06):
            assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.006)


def test_shaking_is_believed(rig: RigMaker) -> None:
    def shaking(t: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return (2 * math.sin(200 * t), 0.0, 0.0), (0.0, 8 * math.cos(170 * t), 9.8)

    samples = rig("bno055", motion=shaking).read_for(1)
    assert len(samples) > 95


def test_perfect_rest_is_no_silence(rig: RigMaker, at_rest: Any) -> None:
    bench = rig("bno055", motion=at_rest)
    samples = bench.read_for(2)
    assert len(samples) > 2 * 100 / 4
    assert samples[-1].stamp_ns == pytest.approx(bench.clock.monotonic_ns(), abs=40e6)


def test_a_system_error_is_mended_by_a_reset(rig: RigMaker) -> None:
    bench = rig("bno055")
    bench.read_for(0.5)
    bench.chip.registers[0x39] = 1
    bench.read_for(2)
    assert bench.device.counts["chip_reset"] == 1
    assert bench.chip.registers[0x39] == 5
