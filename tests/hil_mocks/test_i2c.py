"""The chip models behave as the data sheets say, without a driver."""

import errno
import struct

import pytest

from drivers.imu.registry import names
from drivers.samples import ImuSample
from hil_mocks.i2c import CHIPS, SimulatedBus, replay
from hil_mocks.virtual_clock import VirtualClock

G = 9.80665
IDENTITY = {
    "mpu6050": (0x75, 0x68),
    "mpu6500": (0x75, 0x70),
    "mpu9250": (0x75, 0x71),
    "icm20602": (0x75, 0x12),
    "icm20948": (0x00, 0xEA),
    "icm42688": (0x75, 0x47),
    "lsm6ds3": (0x0F, 0x69),
    "lsm6dso": (0x0F, 0x6C),
    "lsm6dso32": (0x0F, 0x6C),
    "ism330dhcx": (0x0F, 0x6B),
    "lsm6dsv": (0x0F, 0x70),
    "lsm6dsv32": (0x0F, 0x70),
    "lsm9ds1": (0x0F, 0x68),
    "bmi088": (0x00, 0x0F),
    "bmi160": (0x00, 0xD1),
    "bmi270": (0x00, 0x24),
    "qmi8658": (0x00, 0x05),
    "bno055": (0x00, 0xA0),
}


def still(_):
    return (0.0, 0.0, 0.0), (0.0, 0.0, G)


def wired(driver, motion=still, **values):
    clock = VirtualClock()
    chip = CHIPS[driver](motion, clock, **values)
    return clock, chip, SimulatedBus(clock, {chip.address: chip})


def test_every_driver_has_a_model():
    assert list(CHIPS) == names("i2c")


@pytest.mark.parametrize("driver", IDENTITY)
def test_identity_cannot_be_overwritten(driver):
    _, chip, bus = wired(driver)
    register, value = IDENTITY[driver]
    if driver != "icm20948":
        bus.write_byte_data(chip.address, register, 0x55)
    assert bus.read_i2c_block_data(chip.address, register, 1) == [value]


@pytest.mark.parametrize("driver", CHIPS)
def test_asleep_at_power_on_nothing_is_sampled(driver):
    clock, chip, bus = wired(driver)
    if driver in ("mpu6500", "mpu9250", "bmi088"):  # these wake by themselves
        return
    bus.read_i2c_block_data(chip.address, 0, 1)
    clock.sleep_s(1)
    bus.read_i2c_block_data(chip.address, 0, 1)
    assert not chip.made_ns


def test_mpu6050_data_registers_follow_the_ranges():
    clock, _, bus = wired("mpu6050", motion=lambda _: ((1.0, -1.0, 0.5), (1.0, 2.0, -3.0)))
    for gyro_code, accel_code in ((0, 0), (1, 2), (2, 1), (3, 3)):
        bus.write_byte_data(0x68, 0x6B, 0x01)
        bus.write_byte_data(0x68, 0x1B, gyro_code << 3)
        bus.write_byte_data(0x68, 0x1C, accel_code << 3)
        clock.sleep_s(0.01)
        data = bytes(bus.read_i2c_block_data(0x68, 0x3B, 14))
        ax, ay, az, _, gx, gy, gz = struct.unpack(">7h", data)
        lsb_per_g, lsb_per_radps = 16384 >> accel_code, (131.0, 65.5, 32.8, 16.4)[gyro_code] * 57.29578
        assert (ax, ay, az) == pytest.approx([v / G * lsb_per_g for v in (1.0, 2.0, -3.0)], abs=0.51)
        assert (gx, gy, gz) == pytest.approx([v * lsb_per_radps for v in (1.0, -1.0, 0.5)], abs=6)


def test_values_beyond_the_range_are_cut_off():
    clock, _, bus = wired("mpu6050", motion=lambda _: ((100.0, -100.0, 0.0), (-500.0, 500.0, 0.0)))
    bus.write_byte_data(0x68, 0x6B, 0x01)
    clock.sleep_s(0.01)
    words = struct.unpack(">7h", bytes(bus.read_i2c_block_data(0x68, 0x3B, 14)))
    assert (words[0], words[1], words[4], words[5]) == (-32768, 32767, 32767, -32768)


def filled_mpu6050(seconds):
    clock, chip, bus = wired("mpu6050", motion=lambda t: ((0.0, 0.0, 0.0), (t, 0.0, G)))
    for register, value in ((0x6B, 1), (0x19, 4), (0x1A, 2), (0x23, 0x78), (0x6A, 0x40)):
        bus.write_byte_data(0x68, register, value)
    clock.sleep_s(seconds)
    return clock, chip, bus


def count(bus):
    return int.from_bytes(bus.read_i2c_block_data(0x68, 0x72, 2), "big")


def test_mpu6050_fifo_fills_at_the_rate_and_empties_as_it_is_read():
    _, _, bus = filled_mpu6050(0.1)
    assert count(bus) == 20 * 12
    data = bytes(bus.read_i2c_block_data(0x68, 0x74, 24))
    assert struct.unpack(">6h", data[:12])[2] == 16384
    assert count(bus) == 18 * 12


def test_mpu6050_fifo_that_runs_over_loses_its_alignment():
    _, _, bus = filled_mpu6050(1.0)
    assert count(bus) == 1024
    first = struct.unpack(">6h", bytes(bus.read_i2c_block_data(0x68, 0x74, 12)))
    assert first[2] != 16384
    bus.write_byte_data(0x68, 0x6A, 0x44)
    assert count(bus) == 0


@pytest.mark.parametrize(
    ("driver", "reset"),
    [
        ("mpu6050", (0x6B, 0x80)),
        ("icm20948", (0x06, 0x80)),
        ("lsm6ds3", (0x12, 0x01)),
        ("lsm6dso", (0x12, 0x01)),
        ("bmi160", (0x7E, 0xB6)),
        ("bmi270", (0x7E, 0xB6)),
        ("bno055", (0x3F, 0x20)),
    ],
)
def test_reset_brings_power_on_values_back(driver, reset):
    _, chip, bus = wired(driver)
    power_on = bytes(chip.registers)
    for register in (0x10, 0x11, 0x40, 0x42, 0x3B):
        bus.write_byte_data(chip.address, register, 0x5A)
    if driver == "bno055":
        with pytest.raises(OSError, match="Remote I/O"):
            bus.write_byte_data(chip.address, *reset)
        with pytest.raises(OSError, match="Remote I/O"):
            bus.read_i2c_block_data(chip.address, 0x00, 1)
    else:
        bus.write_byte_data(chip.address, *reset)
    assert bytes(chip.registers) == power_on


def test_a_wrong_clock_makes_another_rate():
    clock, chip, bus = wired("mpu6050", rate_error=0.1)
    bus.write_byte_data(0x68, 0x6B, 0x01)
    bus.write_byte_data(0x68, 0x1A, 0x02)
    bus.write_byte_data(0x68, 0x19, 9)
    made = len(chip.made_ns)
    clock.sleep_s(1)
    count(bus)
    assert len(chip.made_ns) - made == pytest.approx(110, abs=1)


def test_replay_is_straight_between_samples_and_holds_the_last():
    motion = replay(
        [
            ImuSample(5_000_000_000, (0.0, 1.0, 2.0), (0.0, 0.0, 10.0)),
            ImuSample(5_500_000_000, (1.0, 1.0, 0.0), (0.0, 5.0, 10.0)),
        ]
    )
    assert motion(0.0) == ((0.0, 1.0, 2.0), (0.0, 0.0, 10.0))
    assert motion(0.25) == ((0.5, 1.0, 1.0), (0.0, 2.5, 10.0))
    assert motion(0.5) == motion(99.0) == ((1.0, 1.0, 0.0), (0.0, 5.0, 10.0))


def test_packing_alone_gives_the_data_registers():
    _, chip, _ = wired("bmi160")
    packed = chip.pack((0.0, 0.0, 0.0), (0.0, 0.0, G))
    assert struct.unpack("<3h", packed[0x12]) == (0, 0, 16384)


@pytest.mark.parametrize("length", [0, 33])
def test_a_transfer_carries_32_bytes_at_most(length):
    _, _, bus = wired("mpu6050")
    with pytest.raises(OSError, match="Invalid"):
        bus.read_i2c_block_data(0x68, 0x3B, length)
    with pytest.raises(OSError, match="Invalid"):
        bus.write_i2c_block_data(0x68, 0x3B, [0] * length)


def test_faults_befall_the_transfers_that_they_are_meant_for():
    clock, _, bus = wired("mpu6050")
    bus.fail(errno.ETIMEDOUT, register=0x75)
    assert bus.read_byte(0x68) == 0
    before_ns = clock.monotonic_ns()
    with pytest.raises(TimeoutError):
        bus.read_i2c_block_data(0x68, 0x75, 1)
    assert clock.monotonic_ns() - before_ns == 1_000_000_000
    bus.flip(0, mask=0x81)
    assert bus.read_i2c_block_data(0x68, 0x75, 1) == [0x68 ^ 0x81]
    assert bus.read_i2c_block_data(0x68, 0x75, 1) == [0x68]
    with pytest.raises(OSError, match="Remote I/O"):
        bus.read_byte(0x11)
