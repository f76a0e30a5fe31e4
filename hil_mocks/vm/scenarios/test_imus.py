"""Inertial samples through `/dev/i2c-N` and through a serial port."""

import threading
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from hil_mocks.vm.daemon import DEFAULT_SETTINGS, Daemon, Subscriber, write_lines
from hil_mocks.vm.machine import Machine
from lcf_edge.rendered import scenes

I2C = '\n[imu]\ndriver = "bno055"\nbus = {bus}\n'
SERIAL = '\n[imu]\ndriver = "csv"\nport = "/dev/lcf-edge/imu"\nbaud = 115200\n'
CHIP = "systemd-run --quiet --collect --unit=bno055 /opt/lcf-edge/bin/python -m hil_mocks.vm.guest.bno055"
SPOIL = "import sys, smbus2; smbus2.SMBus(int(sys.argv[1])).write_i2c_block_data(0x28, 0, [0] * 32)"
WITHOUT_IDENTITY = f"/opt/lcf-edge/bin/python -c '{SPOIL}'"
LINES_HZ = 100
MIN_HZ = 10  # an emulated processor may not keep up


@pytest.fixture(scope="module")
def bus(machine: Machine) -> Iterator[int]:
    """The number of a bus with a living BNO055 on it."""
    samples = scenes.imu(scenes.make("slow_rover", 1, seconds=10.0))[::2]
    write_lines(machine.share / "samples.csv", [[*sample.gyro, *sample.accel] for sample in samples])
    number = int(machine.run("basename $(dirname $(grep -l SMBus.stub /sys/bus/i2c/devices/i2c-*/name))").split("-")[1])
    machine.run(f"{CHIP} {number} /mnt/samples.csv")
    yield number
    machine.run("systemctl stop bno055")


class SerialImu(threading.Thread):
    """Lines into the machine's serial port, from the host; ``garbled``: with noise in between.

    As at the end of a wire, nothing holds up anybody: a line that nobody takes is lost, and what the machine sends (its
    echo, until the port is set up) is thrown away. A full socket would stop qemu, processors included.
    """

    def __init__(self, machine: Machine) -> None:
        super().__init__(name="serial IMU", daemon=True)
        self.garbled = False
        self.ended = threading.Event()
        self._port = machine.imu

    def run(self) -> None:
        """One line each 10 ms."""
        self._port.setblocking(False)
        number, due_s = 0, time.monotonic()
        while not self.ended.wait(max(due_s - time.monotonic(), 0)):
            number, due_s = number + 1, due_s + 1 / LINES_HZ
            line = b"%d,0.01,0.02,0.03,0.1,-9.81,0.1\n" % (number * 1_000_000 // LINES_HZ)
            if self.garbled and number % 10 == 0:
                line = b"\xff\x00" + line[7:]
            with suppress(BlockingIOError):
                self._port.recv(65536)
            with suppress(BlockingIOError):
                self._port.sendall(line)


@pytest.fixture
def serial_imu(machine: Machine) -> Iterator[SerialImu]:
    """An IMU at the serial port, sending."""
    imu = SerialImu(machine)
    imu.start()
    yield imu
    imu.ended.set()
    imu.join()


def wait_for_rate(subscriber: Subscriber, min_hz: float, max_hz: float) -> None:
    """Wait until the IMU's samples are so far apart; what had piled up before comes first."""

    def settled() -> bool:
        return "imu" in subscriber.statuses and min_hz <= float(subscriber.statuses["imu"].values["rate_hz"]) <= max_hz

    subscriber.wait_for(settled, f"imu at {min_hz:g} to {max_hz:g}/s")


def test_a_living_chip_on_the_i2c_bus_is_read(daemon: Daemon, subscriber: Subscriber, bus: int) -> None:
    daemon.start(DEFAULT_SETTINGS + I2C.format(bus=bus))
    subscriber.wait_for_status("imu", "delivers")
    wait_for_rate(subscriber, MIN_HZ, 110)
    subscriber.wait_for_scenes()
    subscriber.wait_for(lambda: "no inertial samples" not in subscriber.message("pipeline"), "inertial samples in use")


def test_a_bus_that_goes_is_used_again(daemon: Daemon, subscriber: Subscriber, bus: int) -> None:
    daemon.start(DEFAULT_SETTINGS + I2C.format(bus=bus))
    subscriber.wait_for_status("imu", "delivers")
    # Whoever has the bus open holds its module: the chip's own registers are what can be taken away.
    daemon.machine.run(f"systemctl stop bno055; {WITHOUT_IDENTITY} {bus}")
    subscriber.wait_for_status("imu", "away since")
    subscriber.wait_for_scenes()
    daemon.machine.run(f"{CHIP} {bus} /mnt/samples.csv")
    subscriber.wait_for_status("imu", "delivers")
    assert daemon.restarts == 0


def test_a_serial_imu_is_read(daemon: Daemon, subscriber: Subscriber, serial_imu: SerialImu) -> None:
    assert serial_imu.is_alive()
    daemon.start(DEFAULT_SETTINGS + SERIAL)
    subscriber.wait_for_status("imu", "delivers")
    wait_for_rate(subscriber, 0.8 * LINES_HZ, 1.2 * LINES_HZ)
    serial_imu.garbled = True
    subscriber.wait_for_count("imu", "bad_line", 5)
    serial_imu.garbled = False
    assert subscriber.message("imu") == "delivers"


def test_a_serial_port_that_is_unplugged_is_used_again(
    daemon: Daemon, subscriber: Subscriber, serial_imu: SerialImu
) -> None:
    assert serial_imu.is_alive()
    daemon.start(DEFAULT_SETTINGS + SERIAL)
    subscriber.wait_for_status("imu", "delivers")
    port = daemon.machine.run("basename $(dirname $(grep -l 'QEMU USB SERIAL' /sys/bus/usb/devices/*/product))")
    daemon.machine.run(f"echo {port} > /sys/bus/usb/drivers/usb/unbind")
    subscriber.wait_for_status("imu", "away since")
    subscriber.wait_for_scenes()
    daemon.machine.run(f"echo {port} > /sys/bus/usb/drivers/usb/bind")
    subscriber.wait_for_status("imu", "delivers")
    assert daemon.restarts == 0
