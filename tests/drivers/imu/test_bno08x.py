"""BNO08x over I2C: the shipped driver and a hub that talks SHTP."""

import errno
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from drivers.device import KeptOpen
from drivers.errors import DeviceMissingError, DeviceStalledError, UnsupportedSettingError
from drivers.imu.bno08x import Bno08x
from drivers.imu.i2c_bus import I2cBus, TransferError
from drivers.imu.settings import ImuSettings

RigMaker = Callable[..., Any]


@pytest.fixture
def bench(rig: RigMaker) -> Any:
    return rig("bno08x")


@pytest.mark.parametrize("rate_error", [-0.03, 0.0, 0.02])
def test_values_and_stamps_are_those_of_the_motion(rig: RigMaker, rate_error: float) -> None:
    bench = rig("bno08x", rate_error=rate_error)
    bench.read_for(3)
    samples = bench.read_for(2)
    assert len(samples) == pytest.approx(2 * 200 * (1 + rate_error), abs=5)
    for sample in samples:
        gyro, accel = bench.true(sample)
        assert sample.gyro == pytest.approx(gyro, abs=0.004)
        assert sample.accel == pytest.approx(accel, abs=0.012)
        assert not sample.saturated
    spacing_ns = [later.stamp_ns - earlier.stamp_ns for earlier, later in pairwise(samples)]
    assert all(spacing == pytest.approx(5e6 / (1 + rate_error), rel=0.02) for spacing in spacing_ns)


@pytest.mark.parametrize(("asked_hz", "granted_hz"), [(50.0, 50.0), (100.0, 100.0), (400.0, 400.0), (1000.0, 400.0)])
def test_the_rate_is_as_asked_up_to_400(rig: RigMaker, asked_hz: float, granted_hz: float) -> None:
    bench = rig("bno08x", settings=ImuSettings(rate_hz=asked_hz))
    samples = bench.read_for(2)
    assert bench.device.rate_hz == pytest.approx(granted_hz)
    assert len(samples) == pytest.approx(2 * granted_hz, rel=0.05, abs=4)


@pytest.mark.parametrize(("axis", "sign"), [(0, 1), (1, -1), (5, 1)])
def test_an_axis_at_the_end_of_its_range_is_reported(rig: RigMaker, axis: int, sign: int) -> None:
    values = [0.0] * 6
    values[axis] = sign * (50.0 if axis < 3 else 100.0)
    bench = rig("bno08x", motion=lambda _: (tuple(values[:3]), tuple(values[3:])))
    sample = bench.read_for(0.3)[-1]
    assert sample.saturated
    largest = max(map(abs, sample.gyro + sample.accel))
    assert largest == pytest.approx(math.radians(2000) if axis < 3 else 8 * 9.80665, rel=0.01)


def test_one_that_was_just_switched_on_is_waited_for(bench: Any) -> None:
    bench.chip.power_up()
    assert bench.read_for(0.5)
    assert bench.device.counts["chip_reset"] == 0


def test_one_that_resets_itself_is_asked_anew_and_counted(bench: Any) -> None:
    bench.read_for(1)
    bench.chip.power_up()
    lost_ns = bench.clock.monotonic_ns()
    samples = bench.read_for(1.5)
    assert bench.device.counts["chip_reset"] == 1
    after = [sample for sample in samples if sample.stamp_ns > lost_ns + 10_000_000]
    assert after[0].stamp_ns - lost_ns < 0.6e9
    for sample in after[40:]:
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.01)


def test_one_that_says_nothing_is_asked_again_and_at_last_reported(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(bench.chip, "send", lambda data: asked.append(data) or b"")
    with pytest.raises(DeviceStalledError, match="answers, but has no samples; switch its supply off and on"):
        bench.read_for(5)
    assert len(asked) >= 2 * 3


def test_reports_that_were_not_read_in_time_are_counted(bench: Any) -> None:
    bench.read_for(2)
    bench.clock.sleep_s(1.2)  # it keeps one second of them
    samples = bench.read_for(1)
    assert bench.device.counts["lost"] == pytest.approx(40, abs=3)
    for sample in samples[-100:]:
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.01)


@pytest.mark.parametrize("at", range(4))
def test_a_header_with_a_flipped_bit_is_refused(bench: Any, at: int) -> None:
    bench.read_for(1)
    before = bench.wire.transfers
    bench.wire.flip(at)
    samples = bench.read_for(0.5)
    assert bench.wire.transfers > before
    for sample in samples:
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.01)


def test_a_value_beyond_the_range_is_a_flipped_bit(bench: Any) -> None:
    bench.read_for(1)
    bench.wire.fail(0, 1)  # a header
    bench.wire.flip(4 + 5 + 10 + 5)  # the high byte of the gyro's x
    bench.read_for(0.1)
    assert bench.device.counts["implausible"] == 1


def test_one_transfer_in_fifty_fails_and_the_rest_is_right(bench: Any) -> None:
    bench.read_for(1)
    samples = []
    for _ in range(20):
        bench.wire.fail(errno.EREMOTEIO)
        samples += bench.read_for(0.25)
    assert bench.device.counts["nack"] == 20
    assert len(samples) > 0.95 * 5 * 200
    for sample in samples:
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.01)


def test_unplugged_and_plugged_in_again_it_comes_back(bench: Any) -> None:
    kept = KeptOpen("imu", bench.open, bench.clock)
    for _ in range(20):
        kept.read()
    chip = bench.wire.chips.pop(0x4A)
    while not kept.error:
        kept.read()
    chip.power_up()
    bench.wire.chips[0x4A] = chip
    plugged_ns = bench.clock.monotonic_ns()
    samples: list[Any] = []
    while not samples:
        samples = list(kept.read())
    assert bench.clock.monotonic_ns() - plugged_ns < 2.5e9


def test_nobody_at_the_address_is_reported_with_who_else_is_there(bench: Any) -> None:
    bench.wire.chips = {0x4B: bench.chip}
    with pytest.raises(DeviceMissingError, match=r"no such chip at 0x4a \(BNO08x\); there is 0x4b; set imu\.address"):
        bench.open()
    assert bench.wire.closed


def test_a_bus_that_hangs_is_given_up(bench: Any) -> None:
    bench.read_for(0.1)
    bench.wire.hanging = True
    with pytest.raises(TransferError, match="timeout until given up"):
        bench.device.read()


def test_a_range_that_it_does_not_have_is_reported(rig: RigMaker) -> None:
    with pytest.raises(UnsupportedSettingError, match=r"has no range 16; set imu\.accel_range_g to one of 2, 4, 8"):
        rig("bno08x", settings=ImuSettings(accel_range_g=16)).open()


def test_it_is_recognised_by_what_it_has_to_say_and_stays_unread(bench: Any) -> None:
    bench.chip.power_up()
    bench.clock.sleep_s(0.3)
    bus = I2cBus(1, bench.wire, bench.clock)
    assert Bno08x.recognised(bus, 0x4A) == "BNO08x"
    assert bench.chip.receive(276)[:3] == b"\x14\x01\x00"
    bench.chip._packets.clear()
    assert Bno08x.recognised(bus, 0x4A) is None
