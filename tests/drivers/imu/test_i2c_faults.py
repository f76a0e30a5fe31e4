"""What goes wrong on the wire and in the chip, made to happen under the shipped drivers; time is turned by hand."""

import errno
import math
import random
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from drivers.device import KeptOpen
from drivers.errors import (
    DeviceBusyError,
    DeviceLostError,
    DeviceMissingError,
    DeviceStalledError,
    DriverError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from drivers.imu.fifo_imu import FifoImu
from drivers.imu.i2c_bus import TransferError
from drivers.imu.i2c_imu import I2cImu
from drivers.imu.registry import chips
from drivers.imu.settings import ImuSettings
from hil_mocks.i2c import CHIPS as MODELS

RigMaker = Callable[..., Any]
CHIPS = [driver for driver, chip in chips().items() if issubclass(chip, I2cImu)]  # those with registers
every_chip = pytest.mark.parametrize("driver", CHIPS)
FIFO_CHIPS = [driver for driver, chip in chips().items() if issubclass(chip, FifoImu)]
ST = ("lsm6ds3", "lsm6dso", "lsm6dso32", "ism330dhcx", "lsm6dsv", "lsm6dsv32")
every_fifo_chip = pytest.mark.parametrize("driver", FIFO_CHIPS)

FIFO_REGISTER = {
    **dict.fromkeys(("mpu6050", "mpu6500", "mpu9250", "icm20602"), 0x74),
    "icm20948": 0x72,
    "icm42688": 0x30,
    "lsm9ds1": 0x18,
    "lsm6ds3": 0x3E,
    "lsm6dso": 0x78,
    "lsm6dso32": 0x78,
    "ism330dhcx": 0x78,
    "lsm6dsv": 0x78,
    "lsm6dsv32": 0x78,
    "bmi088": 0x3F,
    "bmi160": 0x24,
    "bmi270": 0x26,
}

GYRO_SCALE = {  # the register of the gyro's range, of those that are not like the MPU-6050
    "icm20948": 0x2001,
    "icm42688": 0x4F,
    **dict.fromkeys(ST, 0x11),
    **dict.fromkeys(("lsm6dsv", "lsm6dsv32"), 0x15),
    "lsm9ds1": 0x10,
    "bmi088": 0x0F,
    "bmi160": 0x43,
    "bmi270": 0x43,
}


def assert_true(bench: Any, samples: list[Any], within_s: float = 0.003) -> None:
    """Samples are those of the motion: nothing is out of alignment."""
    assert samples
    for sample in samples:
        gyro, accel = bench.true(sample)
        assert sample.gyro == pytest.approx(gyro, abs=0.002 + within_s)
        assert sample.accel == pytest.approx(accel, abs=0.012 + 3 * within_s)


# The wire.


@every_chip
@pytest.mark.parametrize(
    ("number", "reason"),
    [
        (errno.EREMOTEIO, "nack"),
        (errno.ENXIO, "nack"),
        (errno.EIO, "io_error"),
        (errno.EAGAIN, "arbitration_lost"),
        (errno.ETIMEDOUT, "timeout"),
    ],
)
def test_a_failed_transfer_is_tried_again_and_counted(rig: RigMaker, driver: str, number: int, reason: str) -> None:
    bench = rig(driver)
    bench.read_for(1)
    bench.wire.fail(number)
    bench.device.read()
    assert bench.device.counts[reason] == 1
    bench.read_for(0.3)
    assert_true(bench, bench.read_for(1))


@every_chip
def test_one_transfer_in_fifty_fails_and_the_rest_is_right(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(1)
    samples = []
    for _ in range(20):
        bench.wire.fail(errno.EREMOTEIO)
        samples += bench.read_for(0.25)
    assert bench.device.counts["nack"] == 20
    assert_true(bench, samples)
    assert len(samples) > 0.9 * 5 * bench.device.rate_hz


@every_chip
def test_tries_pause_longer_each_time_and_end(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(0.1)
    bench.wire.chips.clear()  # unplugged
    before_ns, before = bench.clock.monotonic_ns(), bench.wire.transfers
    with pytest.raises(TransferError, match="nack until given up; check wiring"):
        bench.read_for(0.1)
    assert bench.wire.transfers - before <= 3 + 2 * 5
    assert 15e6 <= bench.clock.monotonic_ns() - before_ns < 100e6


@every_chip
def test_a_bus_that_hangs_is_given_up_after_three_timeouts(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(0.1)
    bench.wire.hanging = True
    before = bench.wire.transfers
    with pytest.raises(DeviceLostError, match="timeout until given up"):
        bench.device.read()
    assert bench.wire.transfers - before == 3


def test_a_bus_that_hangs_at_opening_is_not_a_missing_chip(rig: RigMaker) -> None:
    bench = rig()
    bench.wire.hanging = True
    with pytest.raises(TransferError, match="0x68 on /dev/i2c-1: timeout"):
        bench.open()
    assert bench.wire.closed


@every_fifo_chip
def test_a_fifo_read_that_fails_halfway_is_never_read_on(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(1)
    bench.wire.fail(errno.EREMOTEIO, register=FIFO_REGISTER[driver])
    assert bench.device.read() == []
    assert bench.device.counts["fifo_broken"] == 1
    assert_true(bench, bench.read_for(0.5))


@every_fifo_chip
def test_a_fifo_whose_reads_always_fail_is_stalled(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(0.1)
    bench.wire.fail(errno.EIO, times=100_000, register=FIFO_REGISTER[driver])
    with pytest.raises(DeviceStalledError, match="answers, but has no samples"):
        bench.read_for(3)


# Who is there.


@every_chip
def test_nobody_at_the_address_is_reported_with_who_else_is_there(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.wire.chips = {0x29: bench.chip, 0x76: bench.chip}
    with pytest.raises(DeviceMissingError) as raised:
        bench.open()
    address = MODELS[driver].address
    assert str(raised.value).startswith(f"/dev/i2c-1: no such chip at 0x{address:02x} (")
    assert str(raised.value).endswith("); there is 0x29, 0x76; set imu.address")
    assert bench.wire.closed


def test_an_empty_bus_is_reported(rig: RigMaker) -> None:
    bench = rig()
    bench.wire.chips.clear()
    with pytest.raises(
        DeviceMissingError, match=r"no such chip at 0x68 .*; no device answers on this bus; check wiring"
    ):
        bench.open()


@every_chip
def test_another_chip_at_the_address_is_reported(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    other = rig("mpu6050" if bench.chip.address == 0x6A else "lsm6ds3").chip
    bench.wire.chips = {bench.chip.address: other}
    with pytest.raises(WrongDeviceError, match=r"says 0x.., a .* says 0x.*; set imu.driver or imu.address"):
        bench.open()


def test_a_chip_that_the_kernel_owns_is_reported(rig: RigMaker) -> None:
    bench = rig()
    bench.wire.owned_by_kernel.add(0x68)
    with pytest.raises(DeviceBusyError, match=r"a kernel driver owns it; set imu.driver to iio"):
        bench.open()


def test_another_address_can_be_set(rig: RigMaker) -> None:
    bench = rig(address=0x69)
    bench.wire.chips = {0x69: bench.chip}
    assert bench.device.name == "MPU-6050 at 0x69 on /dev/i2c-1"
    assert bench.read_for(0.1)


def test_a_range_that_no_chip_has_is_reported(rig: RigMaker) -> None:
    with pytest.raises(UnsupportedSettingError, match=r"set imu.gyro_range_dps to one of 250, 500, 1000, 2000"):
        rig(settings=ImuSettings(gyro_range_dps=300)).open()


@every_fifo_chip
def test_a_chip_that_does_not_keep_a_setting_is_reported(
    rig: RigMaker, driver: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig(driver)
    scale = GYRO_SCALE.get(driver, 0x1B)
    honest = bench.chip._burst

    def counterfeit(register: int, length: int) -> bytes:
        in_bank = driver != "icm20948" or bench.chip.registers[0x7F] == 0x20
        return b"\0" if register == scale & 0xFF and length == 1 and in_bank else honest(register, length)

    monkeypatch.setattr(bench.chip, "_burst", counterfeit)
    with pytest.raises(UnsupportedSettingError, match=f"does not keep what is written to 0x{scale:02x}"):
        bench.open()


# The chip.


@every_chip
def test_whatever_another_program_left_behind_is_reset(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.chip.registers[0x7F] = 0x20  # an ICM-20948's bank
    assert_true(bench, bench.read_for(0.3), within_s=0.01)
    assert bench.chip.resets == (driver != "bno055")  # which is not reset but configured anew


@every_chip
@pytest.mark.parametrize("acknowledged", [True, False])
def test_a_reset_is_done_once_and_a_chip_that_boots_is_left_alone(
    rig: RigMaker, driver: str, acknowledged: bool
) -> None:
    bench = rig(driver)
    for chip in bench.chip.places.values():
        chip.acknowledges_reset = acknowledged
    assert_true(bench, bench.read_for(0.3), within_s=0.01)
    assert all(chip.resets == (driver != "bno055") for chip in bench.chip.places.values())
    if acknowledged:
        assert bench.device.counts["nack"] == 0


@pytest.mark.parametrize("driver", ST)
def test_a_chip_whose_fifo_another_program_left_filling_is_reset_all_the_same(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(0.3)
    again = bench.open()
    assert again.read() is not None
    assert again.counts["nack"] == 0


@every_chip
def test_a_chip_that_reset_itself_is_set_up_again(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(1.2)  # the next look at the settings is far
    bench.chip.power_up()
    reads, samples = 0, []
    while not bench.device.counts["chip_reset"]:
        samples += bench.device.read()
        reads += 1
    assert reads <= 8 * 9  # eight samples' time, looked at closely at most
    if samples:  # made before
        assert_true(bench, samples)
    assert_true(bench, bench.read_for(1), within_s=0.01)
    assert bench.device.counts["chip_reset"] == 1


@every_chip
def test_settings_that_slipped_are_seen_within_half_a_second(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(1)
    for register in (
        0x1B,
        0x2001,
        0x43,
        0x11,
        0x10,
        0x4F,
        0x04,
        0x0F,
        0x3B,
    ):  # of the gyro, of whichever chip
        bench.chip.registers[register] ^= 0x02 if driver != "mpu6050" else 0x08
    bench.read_for(0.6)
    assert bench.device.counts["chip_reset"] == 1
    assert_true(bench, bench.read_for(0.5), within_s=0.01)


@every_fifo_chip
def test_a_fifo_that_ran_over_is_emptied_not_read_on(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(1)
    bench.clock.sleep_s(6)  # the daemon did not get to run
    assert bench.device.read() == []
    assert bench.device.counts["fifo_overflow"] == 1
    samples = bench.read_for(1)
    assert_true(bench, samples, within_s=0.01)
    assert len(samples) > 0.95 * bench.device.rate_hz


@every_fifo_chip
def test_a_late_wake_up_loses_nothing(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(2)
    seen = bench.device.read()
    bench.clock.sleep_s(min(0.15, 0.75 * bench.device.fifo_bytes / bench.device.word_bytes / bench.device.rate_hz))
    samples = seen + bench.read_for(0.5)
    period_s = 1 / bench.device.rate_hz
    gaps = [(later.stamp_ns - earlier.stamp_ns) / 1e9 for earlier, later in pairwise(samples)]
    assert max(gaps) < 1.1 * period_s
    assert_true(bench, samples)


@every_fifo_chip
def test_a_chip_that_stops_sampling_is_stalled(rig: RigMaker, driver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = rig(driver)
    bench.read_for(0.2)
    monkeypatch.setattr(type(bench.chip), "rate_hz", lambda _: 0.0)
    with pytest.raises(DeviceStalledError):
        bench.read_for(2)


@every_chip
def test_unplugged_and_plugged_in_again_it_comes_back(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    kept = KeptOpen("imu", bench.open, bench.clock)
    for _ in range(20):
        kept.read()
    chip = bench.wire.chips.pop(bench.chip.address)
    while not kept.error:
        kept.read()
    for _ in range(4):
        assert kept.read() == []
    assert isinstance(kept.error, DriverError)
    chip.brown_out()
    bench.wire.chips[chip.address] = chip
    plugged_ns = bench.clock.monotonic_ns()
    samples: list[Any] = []
    while not samples:
        samples = list(kept.read())
    assert bench.clock.monotonic_ns() - plugged_ns < 2.5e9
    assert kept.counts["opened"] == 2


@pytest.mark.parametrize(
    ("driver", "model", "gravity"),
    [
        ("lsm6dso", "lsm6dso32", 0.5),
        ("lsm6dso32", "lsm6dso", 2.0),
        ("lsm6dsv", "lsm6dsv32", 0.5),
        ("lsm6dsv32", "lsm6dsv", 2.0),
    ],
)
def test_a_twin_that_says_the_same_of_itself_is_known_by_gravity_at_rest(
    rig: RigMaker, at_rest: Any, driver: str, model: str, gravity: float
) -> None:
    bench = rig(driver, motion=at_rest)
    bench.wire.chips = {0x6A: rig(model, motion=at_rest).chip}
    bench.wire.chips[0x6A]._clock = bench.clock
    with pytest.raises(WrongDeviceError) as raised:
        bench.read_for(1.5)
    assert str(raised.value) == (
        f"{bench.device.name}: measures {gravity:.2f} g at rest instead of 1 g; set imu.driver to {model}"
    )


def test_a_broken_accelerometer_is_reported(rig: RigMaker) -> None:
    bench = rig("lsm6dso", motion=lambda _: ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    with pytest.raises(WrongDeviceError, match=r"0\.00 g at rest instead of 1 g; its accelerometer is broken"):
        bench.read_for(1.5)


def test_a_vehicle_that_drives_off_is_not_judged_before_it_rests(rig: RigMaker, at_rest: Any) -> None:
    def driving(t: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return (0.0, 0.0, math.sin(9 * t)), (0.0, 0.0, 9.8 + 3 * math.sin(20 * t))

    bench = rig("lsm6dso", motion=lambda t: driving(t) if t < 3 else at_rest(t))
    twin = rig("lsm6dso32", motion=bench.chip._motion).chip
    twin._clock = bench.clock
    bench.wire.chips = {0x6A: twin}
    assert bench.read_for(2.8)
    with pytest.raises(WrongDeviceError, match=r"set imu\.driver to lsm6dso32"):
        bench.read_for(2)


@pytest.mark.parametrize("driver", ["lsm6dso", "lsm6dso32", "ism330dhcx"])
def test_lsm6dso_speaks_i2c_alone(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    assert bench.chip.listens_to_i3c
    bench.read_for(0.1)
    assert not bench.chip.listens_to_i3c


def test_lsm6dso_pairs_words_by_their_moment(rig: RigMaker) -> None:
    bench = rig("lsm6dso")
    bench.read_for(1)
    bench.clock.sleep_s(0.05)
    bench.chip.read(0x78, 7)  # somebody else took one word
    samples = bench.read_for(0.5)
    assert bench.device.counts["unpaired"] == 1
    assert_true(bench, samples)


@every_chip
@pytest.mark.parametrize("seed", range(3))
def test_garbage_on_the_wire_is_never_more_than_a_typed_error(
    rig: RigMaker, driver: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = rig(driver)
    bench.read_for(0.1)
    garbage = random.Random(seed)
    monkeypatch.setattr(bench.wire, "read_i2c_block_data", lambda _a, _r, length: list(garbage.randbytes(length)))
    last_ns = 0
    said = []
    for _ in range(30):
        try:
            for sample in bench.device.read():
                assert last_ns < sample.stamp_ns
                assert all(map(math.isfinite, sample.gyro + sample.accel))
                last_ns = sample.stamp_ns
        except DriverError as error:
            said.append(str(error))
    assert not any("\n" in text for text in said)
