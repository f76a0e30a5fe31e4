"""What every I2C chip's driver delivers, against a model of the chip's registers."""

import math
import re
from collections.abc import Callable
from importlib import import_module
from itertools import pairwise
from typing import Any

import pytest

from drivers.clock import SYSTEM_CLOCK
from drivers.errors import DeviceLostError, UnsupportedSettingError, WrongDeviceError
from drivers.imu import mpu6050, registry
from drivers.imu.i2c_bus import I2cBus
from drivers.imu.i2c_chips import chip_on, open_chip
from drivers.imu.i2c_imu import I2cImu
from drivers.imu.registry import chips
from drivers.imu.settings import ImuSettings
from drivers.samples import ImuSample
from hil_mocks.i2c import CHIPS as CHIP_MODELS
from hil_mocks.i2c import SimulatedBus, replay
from hil_mocks.i2c.lsm6 import Lsm6dsTrC
from hil_mocks.i2c.mpu import Icm20689
from hil_mocks.virtual_clock import VirtualClock

RigMaker = Callable[..., Any]
REGISTER_CHIPS = [driver for driver, chip in chips().items() if issubclass(chip, I2cImu)]
every_chip = pytest.mark.parametrize("driver", REGISTER_CHIPS)

# rad/s and m/s² of one count as the kernel's drivers have them (inv_mpu_core.c, st_lsm6dsx_core.c, bmi160_core.c,
# bmi270_core.c, bno055.c); the ICM-20948 as its data sheet has it
INV_GYRO = {250: 0.000133090, 500: 0.000266181, 1000: 0.000532362, 2000: 0.001064724}
ST_GYRO = {dps: math.radians(dps * 35e-6) for dps in (250, 500, 1000, 2000)}  # 8.75 m°/s to 70 m°/s
ST = ("lsm6ds3", "lsm6dso", "lsm6dso32", "ism330dhcx", "lsm6dsv", "lsm6dsv32")
UP_TO_32_G = ("lsm6dso32", "lsm6dsv32")
BMI_GYRO = {250: 133e-6, 500: 266e-6, 1000: 532e-6, 2000: 1065e-6}
QMI_GYRO = {dps: math.radians(dps * 1.024 / 32768) for dps in (250, 500, 1000, 2000)}  # its 500 is 512
BNO_GYRO = dict.fromkeys((250, 500, 1000, 2000), math.radians(1) / 16)  # data sheet: 16 counts for 1 °/s
KERNEL_GYRO = {
    **dict.fromkeys(("mpu6050", "mpu6500", "mpu9250", "icm20602", "icm20948"), INV_GYRO),
    **dict.fromkeys(ST, ST_GYRO),
    **dict.fromkeys(("bmi088", "bmi160", "bmi270"), BMI_GYRO),
    "icm42688": INV_GYRO,
    "qmi8658": QMI_GYRO,
    "lsm9ds1": {250: ST_GYRO[250], 500: ST_GYRO[500], 1000: ST_GYRO[2000], 2000: ST_GYRO[2000]},
    "bno055": BNO_GYRO,
}
KERNEL_ACCEL = {2: 598e-6, 4: 1197e-6, 8: 2394e-6, 16: 4788e-6}
ST_ACCEL = {2: 61e-6 * 9.80665, 4: 122e-6 * 9.80665, 8: 244e-6 * 9.80665, 16: 488e-6 * 9.80665, 32: 976e-6 * 9.80665}

ACCEL = {  # of those that do not have the kernel's
    **dict.fromkeys(ST, ST_ACCEL),
    "lsm9ds1": {**ST_ACCEL, 16: 732e-6 * 9.80665},
    "bmi088": {g: 1.5 * g * 9.80665 / 32768 for g in (2, 4, 8, 16)},  # 3, 6, 12, 24 g
}


@every_chip
def test_values_and_stamps_are_those_of_the_motion(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(2)  # the rate is known after that
    samples = bench.read_for(2)
    assert len(samples) == pytest.approx(2 * bench.device.rate_hz, abs=4)
    for sample in samples:
        gyro, accel = bench.true(sample)
        assert sample.gyro == pytest.approx(gyro, abs=0.003)
        assert sample.accel == pytest.approx(accel, abs=0.012)
        assert not sample.saturated


@every_chip
@pytest.mark.parametrize("rate_error", [-0.03, 0.02])
def test_integral_over_a_frame_is_right_though_the_chips_clock_is_wrong(
    rig: RigMaker, driver: str, rate_error: float
) -> None:
    bench = rig(driver, rate_error=rate_error)
    bench.read_for(2)
    samples = bench.read_for(3)
    spacing_s = [(later.stamp_ns - earlier.stamp_ns) / 1e9 for earlier, later in pairwise(samples)]
    frame = round(0.05 * bench.device.rate_hz)
    true_s = frame / (bench.chip.rate_hz() * (1 + rate_error))
    for begin in range(0, len(spacing_s) - frame, frame):
        assert sum(spacing_s[begin : begin + frame]) == pytest.approx(true_s, rel=0.01)


@every_chip
def test_a_slow_bus_loses_nothing(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.wire.speed_hz = 100_000
    bench.read_for(2)
    samples = bench.read_for(1)
    assert len(samples) == pytest.approx(bench.device.rate_hz, abs=4)
    for sample in samples:
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.005)


@every_chip
def test_stamps_increase_and_run_ahead_by_a_tenth_of_a_period_at_most(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    last_ns = bench.clock.monotonic_ns()
    slack_ns = 0.1e9 / bench.device.rate_hz
    for _ in range(60):
        for sample in bench.device.read():
            assert last_ns < sample.stamp_ns < bench.clock.monotonic_ns() + slack_ns
            last_ns = sample.stamp_ns


@every_chip
@pytest.mark.parametrize("gyro_range_dps", [250, 500, 1000, 2000])
def test_gyro_count_is_the_kernels(rig: RigMaker, driver: str, gyro_range_dps: int) -> None:
    expected = KERNEL_GYRO[driver][gyro_range_dps]

    def motion(t: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return (expected * 1000, expected * math.sin(t), 0.0), (0.0, 0.0, 9.8)

    bench = rig(driver, motion=motion, settings=ImuSettings(gyro_range_dps=gyro_range_dps))
    samples = bench.read_for(0.3)
    assert samples[-1].gyro[0] / 1000 == pytest.approx(expected, rel=0.01)


@every_chip
@pytest.mark.parametrize("accel_range_g", [2, 4, 8, 16, 32])
def test_accelerometer_count_is_the_kernels(rig: RigMaker, driver: str, accel_range_g: int) -> None:
    settings = ImuSettings(accel_range_g=accel_range_g)
    if accel_range_g == 32 and driver not in UP_TO_32_G:
        with pytest.raises(UnsupportedSettingError, match=r"imu\.accel_range_g to one of 2, 4"):
            rig(driver, settings=settings).open()
        return
    if driver == "bno055":
        if accel_range_g > 4:
            with pytest.raises(UnsupportedSettingError, match=r"imu\.accel_range_g to one of 2, 4"):
                rig(driver, settings=settings).open()
        return
    if driver in UP_TO_32_G and accel_range_g == 2:
        with pytest.raises(UnsupportedSettingError, match=r"imu\.accel_range_g to one of 4, 8, 16, 32"):
            rig(driver, settings=settings).open()
        return
    expected = ACCEL.get(driver, KERNEL_ACCEL)[accel_range_g]

    def motion(_: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return (0.0, 0.0, 0.0), (expected, 1000 * expected, 0.0)

    samples = rig(driver, motion=motion, settings=settings).read_for(0.3)
    assert samples[-1].accel == pytest.approx((expected, 1000 * expected, 0.0), rel=2e-3, abs=1e-9)


RANGE_OF_4_G = {"bmi088": 6}  # of those that have no range of 4 g


@every_chip
@pytest.mark.parametrize(("axis", "sign"), [(0, 1), (1, -1), (5, 1)])
def test_an_axis_at_the_end_of_its_range_is_reported(rig: RigMaker, driver: str, axis: int, sign: int) -> None:
    values = [0.0] * 6
    values[axis] = sign * (50.0 if axis < 3 else 100.0)
    bench = rig(driver, motion=lambda _: (tuple(values[:3]), tuple(values[3:])))
    samples = bench.read_for(0.3)
    assert all(sample.saturated for sample in samples)
    largest = max(map(abs, samples[-1].gyro + samples[-1].accel))
    asked = math.radians(2000 if driver == "bno055" else 500) if axis < 3 else RANGE_OF_4_G.get(driver, 4) * 9.80665
    assert largest == pytest.approx(asked, rel=0.15)  # ST's words reach beyond its range


@every_chip
def test_half_of_the_range_is_not_saturated(rig: RigMaker, driver: str) -> None:
    half = (math.radians(250), -math.radians(250), 0.0), (-19.0, 19.0, 0.0)
    assert not any(sample.saturated for sample in rig(driver, motion=lambda _: half).read_for(0.2))


FEW_RATES_HZ = {"bno055": (100.0,), "bmi088": (100.0, 200.0, 400.0)}


@every_chip
@pytest.mark.parametrize("asked_hz", [10.0, 100.0, 400.0, 1000.0])
def test_rate_is_the_closest_that_the_chip_has(rig: RigMaker, driver: str, asked_hz: float) -> None:
    bench = rig(driver, settings=ImuSettings(rate_hz=asked_hz))
    assert bench.device.rate_hz == pytest.approx(bench.chip.rate_hz())
    if driver in FEW_RATES_HZ:
        assert bench.device.rate_hz == min(FEW_RATES_HZ[driver], key=lambda offered: abs(offered - asked_hz))
    else:
        min_hz = 28.1  # that every chip can be slowed to
        assert bench.device.rate_hz == pytest.approx(asked_hz, rel=0.25) or asked_hz <= bench.device.rate_hz < min_hz
    samples = bench.read_for(2)
    assert len(samples) == pytest.approx(2 * bench.device.rate_hz, abs=0.03 * bench.device.rate_hz + 2)


@every_chip
def test_temperature_of_the_die(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.chip.celsius = -12.0
    bench.read_for(1.2)
    assert bench.device.temperature_c == pytest.approx(-12.0, abs=0.1)


def test_lsm6ds3tr_c_has_a_thermometer_of_its_own() -> None:
    clock = VirtualClock()
    chip = Lsm6dsTrC(lambda _: ((0.0, 0.0, 0.0), (0.0, 0.0, 9.8)), clock, celsius=41.0)
    device = chip_on(I2cBus(1, SimulatedBus(clock, {0x6A: chip}), clock), "lsm6ds3", clock=clock)
    for _ in range(10):
        device.read()
    assert device.temperature_c == pytest.approx(41.0, abs=0.1)


def test_an_icm20689_sold_as_mpu6050_runs_as_mpu6500_with_its_own_thermometer(rig: RigMaker) -> None:
    bench = rig("mpu6500")
    chip = Icm20689(bench.motion, bench.clock, celsius=41.0)
    bench.wire.chips = {0x68: chip}
    bench.read_for(1.2)
    assert bench.device.model == "ICM-20689"
    assert bench.device.temperature_c == pytest.approx(41.0, abs=0.1)
    bench.clock.sleep_s(2)  # its FIFO runs over
    bench.device.read()
    assert bench.device.counts["fifo_overflow"] == 1
    for sample in bench.read_for(0.5):
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.01)


@pytest.mark.parametrize(
    ("driver", "identity"),
    [
        *(("mpu6500", identity) for identity in (0x70, 0x72, 0x74, 0x78, 0xA6, 0xA9, 0xAE, 0xAF)),
        *(("icm20602", identity) for identity in (0x11, 0x12, 0x19)),
    ],
)
def test_the_whole_6500_family_is_known(rig: RigMaker, driver: str, identity: int) -> None:
    bench = rig(driver)
    bench.chip.registers[0x75] = identity
    bench.chip.power_on = {**bench.chip.power_on, 0x75: identity}
    for sample in bench.read_for(0.5):
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.01)


@pytest.mark.parametrize(
    ("driver", "identity", "remedy"),
    [
        *(("mpu6050", identity, "mpu6500") for identity in (0x70, 0x72, 0x74, 0x78, 0x98)),
        ("mpu6050", 0x71, "mpu9250"),
        ("mpu6500", 0x68, "mpu6050"),
        ("mpu6500", 0x73, "mpu9250"),
        ("mpu9250", 0x70, "mpu6500"),
        ("mpu6500", 0x12, "icm20602"),
        ("icm20602", 0xAF, "mpu6500"),
        ("mpu6050", 0x19, "icm20602"),
        ("lsm6ds3", 0x6C, "lsm6dso"),
        ("lsm6dso", 0x6B, "ism330dhcx"),
        ("lsm6dso", 0x70, "lsm6dsv"),
    ],
)
def test_a_relative_is_reported_with_its_driver(rig: RigMaker, driver: str, identity: int, remedy: str) -> None:
    bench = rig(driver)
    bench.chip.registers[registry.DRIVERS[driver].load().identity_register] = identity
    with pytest.raises(WrongDeviceError, match=rf"says 0x{identity:02x}, .*; set imu\.driver to {remedy}$"):
        bench.open()


@every_chip
def test_a_copy_with_an_unknown_identity_is_refused_by_default_and_taken_when_it_is_named(
    rig: RigMaker, driver: str
) -> None:
    bench = rig(driver)
    register = registry.DRIVERS[driver].load().identity_register
    bench.chip.registers[register] = 0x5E
    bench.chip.power_on = {**bench.chip.power_on, register: 0x5E}
    with pytest.raises(WrongDeviceError, match=r"says 0x5e, .* or imu\.identity to 0x5e if it is a copy$"):
        bench.open()
    bench.settings = ImuSettings(identity=0x5E)
    bench.read_for(0.3)
    assert bench.device.model.endswith("(a copy)")


MAX_TRANSFERS = {"lsm9ds1": 600, "bmi088": 350}  # a FIFO that is read sample by sample; two FIFOs


@every_chip
def test_one_second_takes_few_transfers(rig: RigMaker, driver: str) -> None:
    bench = rig(driver)
    bench.read_for(1)
    before = bench.wire.transfers
    bench.read_for(1)
    assert bench.wire.transfers - before < MAX_TRANSFERS.get(driver, 250)


@every_chip
def test_a_recording_comes_out_as_it_was(rig: RigMaker, driver: str) -> None:
    """Played by the chip, read by the driver: the same angle in the end."""
    samples = [
        ImuSample(7_000_000_000 + n * 5_000_000, (0.3 * math.sin(n / 90), 0.001 * n, -0.2), (0.1, -9.7, 0.01 * n))
        for n in range(800)
    ]
    bench = rig(driver, motion=replay(samples), rate_error=0.015)
    bench.read_for(1)
    begin_s = (bench.clock.monotonic_ns() - bench.began_ns) / 1e9
    read = bench.read_for(1)
    for axis in range(3):
        turned = sum(s.gyro[axis] for s in read) / len(read)
        true = [s.gyro[axis] for s in samples if begin_s <= s.stamp_ns / 1e9 - 7 < begin_s + 1]
        assert turned == pytest.approx(sum(true) / len(true), abs=0.004)


def test_closing_lets_the_bus_go_and_may_happen_twice(rig: RigMaker) -> None:
    bench = rig()
    bench.device.close()
    bench.device.close()
    assert bench.wire.closed
    with pytest.raises(DeviceLostError, match="/dev/i2c-1: is closed; open it again"):
        bench.device.read()


def test_unknown_chip_is_reported_with_the_known_ones() -> None:
    with pytest.raises(UnsupportedSettingError, match=r"nosuch: no such chip; set imu\.driver to one of mpu6050, "):
        chip_on(I2cBus(1, SimulatedBus(VirtualClock(), {})), "nosuch")


@pytest.mark.parametrize("driver", registry.names("i2c"))
def test_by_hand_without_a_bus_says_so_in_one_line(driver: str, capsys: pytest.CaptureFixture[str]) -> None:
    main = import_module(f"drivers.imu.{driver}").main
    assert main(["--bus", "217", "--address", "0x69"]) == 1
    output = capsys.readouterr()
    assert (output.out, output.err.count("\n")) == ("", 1)
    assert output.err.startswith("/dev/i2c-217: no such bus; ")


def test_by_hand_it_tells_rate_and_values(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.by_hand.REPORT_NS", 200_000_000)
    chip = CHIP_MODELS["mpu6050"](lambda _: ((0.0, 0.0, 0.5), (0.0, 0.0, 9.8)), SYSTEM_CLOCK)
    wire = SimulatedBus(SYSTEM_CLOCK, {chip.address: chip})
    monkeypatch.setattr("drivers.imu.i2c_bus.smbus2.SMBus", lambda: wire)
    assert mpu6050.main(["--rate", "100", "--seconds", "0.5"]) == 0
    line = capsys.readouterr().out.splitlines()[0]
    assert re.search(r"\d Hz, every .* no errors  gyro  \+0.0000  \+0.0000  \+0.\d+ rad/s", line)
    assert wire.closed


def test_open_chip_names_the_bus_that_is_missing() -> None:
    with pytest.raises(Exception, match="/dev/i2c-217: no such bus"):
        open_chip("bmi160", 217)
