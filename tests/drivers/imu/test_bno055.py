"""BNO055: what bus masters that do not wait for a stretched clock make of its bytes."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from drivers.device import KeptOpen
from drivers.errors import DeviceLostError
from hil_mocks.i2c.bno055 import TO_CONFIG_S, Bno055

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
    """Though it does not acknowledge that, nor anything until it has booted."""
    bench = rig("bno055")
    bench.read_for(0.5)
    bench.chip.registers[0x39] = 1
    bench.read_for(2)
    assert bench.device.counts["chip_reset"] == bench.chip.resets == 1
    assert bench.chip.registers[0x39] == 5


def test_a_chip_that_never_comes_back_from_its_reset_is_reported(
    rig: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hil_mocks.i2c.bno055.Bno055.boot_ns", 60 * 10**9)
    bench = rig("bno055")
    bench.read_for(0.5)
    bench.chip.registers[0x39] = 1
    with pytest.raises(DeviceLostError, match="does not come back from a reset; switch its supply off and on"):
        bench.read_for(2)


def test_it_starts_without_a_reset_and_at_once(rig: RigMaker) -> None:
    bench = rig("bno055")
    assert bench.read_for(0.2)
    assert bench.chip.resets == 0
    assert bench.clock.monotonic_ns() - bench.began_ns < 0.3e9


def test_settings_that_another_program_left_are_written_anew(rig: RigMaker) -> None:
    """Units of mg and radians, turned axes, a running fusion mode, in which no setting is taken."""
    bench = rig("bno055", motion=lambda _: ((0.2, -0.1, 0.3), (1.0, -2.0, 9.8)))
    left = bench.chip.registers
    left[0x07], left[0x3B], left[0x3D], left[0x41] = 0, 0x83, 0x0C, 0x21
    samples = bench.read_for(0.3)
    assert samples[-1].gyro == pytest.approx((0.2, -0.1, 0.3), abs=0.001)
    assert samples[-1].accel == pytest.approx((1.0, -2.0, 9.8), abs=0.01)
    assert bench.chip.resets == 0


def test_after_a_brown_out_it_is_back_when_it_has_booted(rig: RigMaker) -> None:
    bench = rig("bno055")
    kept = KeptOpen("imu", bench.open, bench.clock)
    while not kept.read():
        pass
    bench.chip.brown_out()
    began_ns = bench.clock.monotonic_ns()
    while not kept.read():
        assert bench.clock.monotonic_ns() - began_ns < 2e9
    assert bench.clock.monotonic_ns() - began_ns > Bno055.boot_ns
    assert bench.chip.resets == 1


def test_the_model_takes_no_setting_before_it_is_in_config(rig: RigMaker) -> None:
    bench = rig("bno055")
    bench.read_for(0.2)
    chip = bench.chip
    chip.write(0x3D, b"\0")
    bench.clock.sleep_s(TO_CONFIG_S - 0.001)
    chip.write(0x3B, b"\x80")
    assert chip.read(0x3B, 1) == b"\0"
    bench.clock.sleep_s(0.001)
    chip.write(0x3B, b"\x80")
    assert chip.read(0x3B, 1) == b"\x80"
