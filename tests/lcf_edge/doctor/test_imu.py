"""The IMU's check, with the shipped drivers on chips as registers and on a serial IMU at a terminal."""

import itertools
import math
import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.imu.i2c_bus import I2cBus
from drivers.imu.i2c_chips import chip_on
from drivers.imu.iio import Iio
from drivers.imu.settings import DEFAULT_SETTINGS, ImuSettings
from drivers.samples import ImuSample
from hil_mocks.i2c import CHIPS, Motion, SimulatedBus
from hil_mocks.serial_imu import ENCODERS, SerialImuStandIn
from hil_mocks.virtual_clock import VirtualClock
from lcf_edge.config import Config, Imu
from lcf_edge.devices import open_imu
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.doctor import imu, wiring
from lcf_edge.doctor.daemon import Daemon
from lcf_edge.doctor.examination import LIMIT_S
from lcf_edge.doctor.finding import Context, Finding, Severity

Machine = Callable[..., Context]
Write = Callable[[str, str], None]


def resting(gravity_mps2: float = 9.81, turn_radps: float = 0.01) -> Motion:
    """With a tremble, as every real one has."""
    return lambda t: ((turn_radps, 0.0, 0.003 * math.sin(50 * t)), (0.02 * math.sin(70 * t), 0.0, gravity_mps2))


class Bus:
    """A bus with a chip; ``wire`` can be made to fail."""

    def __init__(self, clock: VirtualClock, driver: str, motion: Motion, address: int = 0) -> None:
        chip = CHIPS[driver](motion, clock)
        self.clock = clock
        places = dict(chip.places)
        places[address or chip.address] = places.pop(chip.address)
        self.wire = SimulatedBus(clock, places)

    def open(self, number: int) -> I2cBus:
        return I2cBus(number, self.wire, self.clock)

    def imu(self, config: Config, clock: Clock) -> object:
        wanted = config.imu
        settings = ImuSettings(wanted.rate_hz, identity=wanted.identity)
        return chip_on(self.open(wanted.bus), wanted.driver, wanted.address, settings, clock=clock)


@pytest.fixture
def look(machine: Machine, clock: VirtualClock, write: Write) -> Callable[..., list[Finding]]:
    """What is found with a chip at the bus; ``wanted``: the configuration."""

    def find(wanted: Imu, driver: str, motion: Motion | None = None, address: int = 0) -> list[Finding]:
        write("dev/i2c-1", "")
        bus = Bus(clock, driver, motion or resting(), address)
        return list(imu.check(machine(Config(imu=wanted), open_imu=bus.imu, open_bus=bus.open)))

    return find


Look = Callable[..., list[Finding]]


def only(findings: list[Finding]) -> Finding:
    (found,) = findings
    return found


def bad(findings: list[Finding]) -> Finding:
    return only([finding for finding in findings if finding.level is not Severity.OK])


@pytest.mark.parametrize("driver", [driver for driver in CHIPS if driver != "bmi270"])  # that one wants its firmware
def test_a_chip_at_rest_is_reported_with_rate_gravity_and_bias(look: Look, driver: str) -> None:
    rate, gravity, bias = look(Imu(driver=driver), driver)  # type: ignore[arg-type]
    assert {finding.level for finding in (rate, gravity, bias)} == {Severity.OK}
    assert "/s, jitter " in rate.text
    assert gravity.text.startswith("gravity 9.8")
    assert bias.text.startswith("gyro at rest 0.0")


@pytest.mark.parametrize("driver", CHIPS)
@pytest.mark.parametrize("last", [0, 1])
def test_every_chip_is_recognised_at_both_addresses(clock: VirtualClock, driver: str, last: int) -> None:
    address = CHIPS[driver].address | last
    found = list(wiring.chips(Bus(clock, driver, resting(), address).open(1)))
    named = {"lsm6dso32": "lsm6dso", "lsm6dsv32": "lsm6dsv"}.get(driver, driver)  # which say the same of themselves
    assert [(chip.driver, chip.address) for chip in found] == [(named, address)]


def test_a_chip_at_the_other_address_comes_with_the_setting(look: Look) -> None:
    found = only(look(Imu(driver="icm20948"), "icm20948", address=0x69))
    assert found.level is Severity.FAIL
    assert found.text.endswith("; found ICM-20948 at 0x69")
    assert found.remedy.startswith("lcf-edge doctor --set imu.driver=icm20948 --set imu.address=0x69 ")


def test_another_chip_is_recognised(look: Look) -> None:
    found = only(look(Imu(driver="mpu6050"), "mpu6500"))
    assert "--set imu.driver=mpu6500 --set imu.address=0x68" in found.remedy


def test_without_a_driver_the_chip_that_is_there_is_proposed(look: Look) -> None:
    found = only(look(Imu(), "lsm6dso"))
    assert found.level is Severity.WARN
    assert found.remedy.startswith("lcf-edge doctor --set imu.driver=lsm6dso --set imu.address=0x6a ")


def test_a_copy_that_no_driver_knows_is_reported_and_how_to_learn_what_it_says(
    machine: Machine, clock: VirtualClock, write: Write
) -> None:
    write("dev/i2c-1", "")
    bus = Bus(clock, "mpu6500", resting())
    bus.wire.chips[0x68].power_on = {**bus.wire.chips[0x68].power_on, 0x75: 0x5E}
    bus.wire.chips[0x68].power_up()

    def look(wanted: Imu) -> list[Finding]:
        return list(imu.check(machine(Config(imu=wanted), open_imu=bus.imu, open_bus=bus.open)))

    found = only(look(Imu()))
    assert found.level is Severity.WARN
    assert found.text.endswith("; at 0x68 on i2c-1 is a device that no driver recognises: a copy of an IMU?")
    assert found.remedy.startswith("lcf-edge doctor --set imu.driver=mpu6500 --set imu.address=0x68 ")
    refused = only(look(Imu(driver="mpu6500", address=0x68)))
    assert refused.text.endswith("or imu.identity to 0x5e if it is a copy")
    assert {finding.level for finding in look(Imu(driver="mpu6500", address=0x68, identity=0x5E))} == {Severity.OK}


def test_what_the_kernel_owns_is_no_unknown_imu(machine: Machine, clock: VirtualClock, write: Write) -> None:
    write("dev/i2c-1", "")
    bus = Bus(clock, "mpu6500", resting())
    bus.wire.owned_by_kernel.add(0x68)  # as a clock of real time
    assert "0x68" not in only(list(imu.check(machine(Config(imu=Imu()), open_bus=bus.open)))).text


def test_an_empty_bus_asks_for_the_wiring(machine: Machine, clock: VirtualClock, write: Write) -> None:
    write("dev/i2c-1", "")
    bus = Bus(clock, "mpu6050", resting())
    bus.wire.chips.clear()
    context = machine(Config(imu=Imu(driver="mpu6050")), open_imu=bus.imu, open_bus=bus.open)
    found = only(list(imu.check(context)))
    assert "no device answers on this bus" in found.text
    assert found.remedy.startswith("sudo i2cdetect -y 1")


def test_a_bus_that_hangs_is_given_up_in_time(machine: Machine, clock: VirtualClock, write: Write) -> None:
    write("dev/i2c-1", "")
    bus = Bus(clock, "mpu6050", resting())
    bus.wire.hanging = True
    context = machine(Config(imu=Imu(driver="mpu6050")), open_imu=bus.imu, open_bus=bus.open)
    began_ns = clock.monotonic_ns()
    found = only(list(imu.check(context)))
    assert "timeout until given up; check wiring" in found.text
    assert clock.monotonic_ns() - began_ns < LIMIT_S / 2 * 1e9


def test_an_iio_device_that_is_missing_wants_its_driver(machine: Machine, tmp_path: Path) -> None:
    context = machine(
        Config(imu=Imu(driver="iio")),
        open_imu=lambda _, clock: Iio("", DEFAULT_SETTINGS, root=tmp_path / "sys", clock=clock),
    )
    found = only(list(imu.check(context)))
    assert "there is no gyro at all" in found.text
    assert found.remedy.startswith("sudo modprobe inv_mpu6050_i2c")


def test_a_chip_of_the_kernels_is_read_through_iio(machine: Machine, clock: VirtualClock, write: Write) -> None:
    write("dev/i2c-1", "")
    bus = Bus(clock, "mpu6050", resting())
    bus.wire.owned_by_kernel.add(0x68)
    context = machine(Config(imu=Imu(driver="mpu6050")), open_imu=bus.imu, open_bus=bus.open)
    assert "--set imu.driver=iio" in only(list(imu.check(context))).remedy


@pytest.mark.parametrize(
    ("files", "wanted", "remedy"),
    [
        ({}, Imu(driver="mpu6050"), "sudo modprobe i2c-dev"),
        ({"sys/bus/i2c/devices/i2c-1": ""}, Imu(driver="mpu6050"), "sudo modprobe i2c-dev"),
        (
            {"sys/firmware/devicetree/base/model": "Raspberry Pi 4\0"},
            Imu(driver="mpu6050"),
            "sudo raspi-config nonint do_i2c 0",
        ),
        (
            {"sys/firmware/devicetree/base/model": "Raspberry Pi 4\0"},
            Imu(driver="bno055", bus=3),
            "echo dtoverlay=i2c-gpio,bus=3 | sudo tee -a /boot/firmware/config.txt",
        ),
        ({"dev/i2c-7": ""}, Imu(driver="mpu6050"), "lcf-edge doctor --set imu.bus=7"),
    ],
)
def test_a_bus_that_is_missing_comes_with_what_brings_it(
    machine: Machine, tmp_path: Path, write: Write, files: dict[str, str], wanted: Imu, remedy: str
) -> None:
    for name, text in files.items():
        write(name, text)

    def opened(config: Config, clock: Clock) -> object:
        return chip_on(I2cBus(config.imu.bus, clock=clock, dev=tmp_path / "dev"), config.imu.driver)

    found = only(list(imu.check(machine(Config(imu=wanted), open_imu=opened))))
    assert found.level is Severity.FAIL
    assert "no such bus" in found.text
    assert found.remedy.startswith(remedy)


def test_flipped_bits_recommend_the_software_bus(machine: Machine, clock: VirtualClock, write: Write) -> None:
    write("dev/i2c-1", "")
    bus = Bus(clock, "bno055", resting())
    context = machine(Config(imu=Imu(driver="bno055")), open_bus=bus.open)

    def opened(config: Config, clock: Clock) -> object:
        device = bus.imu(config, clock)
        for _ in range(3):
            bus.wire.fail(0, 5, register=0x08)  # good reads, then one with a flipped top bit
            bus.wire.flip(1, register=0x08)
        return device

    found = bad(list(imu.check(_with(context, opened))))
    assert found.level is Severity.WARN
    assert found.remedy.startswith("echo dtoverlay=i2c-gpio,bus=3")


def _with(context: Context, opened: object) -> Context:
    context.__dict__["open_imu"] = opened
    return context


def test_a_noisy_wire_is_reported(machine: Machine, clock: VirtualClock, write: Write) -> None:
    write("dev/i2c-1", "")
    bus = Bus(clock, "mpu6050", resting())

    def opened(config: Config, clock: Clock) -> object:
        device = bus.imu(config, clock)
        for _ in range(20):
            bus.wire.fail(121, 1)
            bus.wire.fail(0, 3)
        return device

    found = bad(list(imu.check(machine(Config(imu=Imu(driver="mpu6050")), open_imu=opened, open_bus=bus.open))))
    assert found.text.startswith("losses: ")
    assert "nack 20" in found.text


@pytest.mark.parametrize(
    ("motion", "level", "text"),
    [
        (resting(gravity_mps2=9.2), Severity.WARN, "gravity 9.20 m/s² (x, y, z: +0.00, +0.00, +9.20) instead of 9.81"),
        (resting(gravity_mps2=1.0), Severity.FAIL, "gravity 1.00 m/s²"),
        (resting(turn_radps=0.3), Severity.WARN, "gyro at rest 0.3"),
        (lambda t: ((t % 1, 0.0, 0.0), (0.0, 0.0, 9.81)), Severity.WARN, "moving"),
    ],
)
def test_what_no_imu_at_rest_shows(look: Look, motion: Motion, level: Severity, text: str) -> None:
    found = bad(look(Imu(driver="mpu6050"), "mpu6050", motion))
    assert found.level is level
    assert found.text.startswith(text)


# Serial ports.


def trembling(rate_hz: float) -> Iterator[ImuSample]:
    chance = random.Random(1)
    for number in itertools.count():
        noise = [chance.gauss(0, 0.002) for _ in range(6)]
        yield ImuSample(
            round(number * 1e9 / rate_hz), (noise[0], noise[1], noise[2]), (noise[3], noise[4], 9.81 + noise[5])
        )


@pytest.fixture
def plugged(tmp_path: Path) -> Iterator[Callable[..., str]]:
    """A serial IMU that plays. Return its port."""
    there: list[SerialImuStandIn] = []

    def plug(protocol: str, rate_hz: float = 200.0) -> str:
        one = SerialImuStandIn(ENCODERS[protocol](), trembling(rate_hz), tmp_path / "imu")
        there.append(one)
        one.play()
        return one.port

    yield plug
    for one in there:
        one.close()


@pytest.fixture
def listen(machine: Machine) -> Callable[..., list[Finding]]:
    def find(wanted: Imu, **others: object) -> list[Finding]:
        return list(imu.check(machine(Config(imu=wanted), open_imu=open_imu, clock=SYSTEM_CLOCK, **others)))

    return find


def test_a_serial_imu_at_rest_is_reported(
    listen: Look, plugged: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(imu, "SECONDS", 0.5)
    found = listen(Imu(driver="witmotion", port=plugged("witmotion")))
    assert {finding.level for finding in found} == {Severity.OK}
    assert [finding.text.split()[0] for finding in found] == ["witmotion", "gravity", "gyro"]


def test_another_protocol_at_another_rate_is_recognised(
    listen: Look, plugged: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wiring, "LISTENED_S", 0.2)
    found = only(listen(Imu(driver="csv", baud=9600, port=plugged("xsens", 400.0))))
    assert found.level is Severity.FAIL
    assert found.text.endswith("it speaks xsens at 115200 baud")
    assert found.remedy.startswith("lcf-edge doctor --set imu.driver=xsens --set imu.baud=115200 ")


def test_a_port_in_use_names_the_program(
    listen: Look, plugged: Callable[..., str], process: Callable[..., None]
) -> None:
    port = plugged("csv")
    process(99, "/usr/sbin/ModemManager", opened=(str(Path(port).resolve()),))
    wanted = Imu(driver="csv", port=port)
    with_it = open_imu(Config(imu=wanted))
    assert with_it is not None
    found = only(listen(wanted))
    with_it.close()
    assert found.text == f"{port}: in use by ModemManager, process 99"


def test_a_missing_port_names_those_that_are_there(listen: Look, write: Write, tmp_path: Path) -> None:
    write("dev/ttyACM0", "")
    found = only(listen(Imu(driver="csv", port="/dev/no-such-port")))
    assert found.remedy.startswith(f"lcf-edge doctor --set imu.port={tmp_path}/dev/ttyACM0 ")


def test_an_adapter_that_holds_bytes_back_is_reported(listen: Look, write: Write, tmp_path: Path) -> None:
    write("sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "16\n")
    first, *_ = listen(Imu(driver="csv", port=str(tmp_path / "dev/ttyUSB0")))
    assert (first.level, first.text) == (Severity.WARN, "ttyUSB0: the adapter holds bytes back for 16 ms")
    assert first.remedy.startswith("echo 1 | sudo tee ")


# The daemon has it.


def untouched(config: Config, clock: Clock) -> object:
    raise AssertionError(f"opened {config} {clock}")


def test_an_imu_that_the_daemon_has_is_not_opened_but_asked_for(
    machine: Machine, write: Write, process: Callable[..., None], tmp_path: Path
) -> None:
    write("dev/i2c-1", "")
    process(7, "lcf-edge", "run", opened=(str(tmp_path / "dev/i2c-1"),))
    context = machine(Config(imu=Imu(driver="mpu6050")), open_imu=untouched)
    found = only(list(imu.check(context)))
    assert found.text.startswith("not opened: lcf-edge run, process 7 may be using it")
    status = DeviceStatus("imu", Level.OK, "delivers", {"rate_hz": "200.00"})
    context.__dict__["daemon"] = Daemon("tcp/127.0.0.1:7447", {"imu": status}, "")
    found = only(list(imu.check(context)))
    assert (found.level, found.text) == (Severity.OK, "in use by the daemon: delivers (rate_hz 200.00)")


def test_a_daemon_without_an_imu_leaves_it_to_others(
    machine: Machine, write: Write, process: Callable[..., None], clock: VirtualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    write("dev/i2c-1", "")
    process(7, "lcf-edge", "run")
    bus = Bus(clock, "mpu6050", resting())
    context = machine(Config(imu=Imu(driver="mpu6050")), open_imu=bus.imu, open_bus=bus.open)
    context.__dict__["daemon"] = Daemon("tcp/127.0.0.1:7447", {}, "")

    def forbidden(_: Path) -> Iterator[Path]:
        raise PermissionError

    monkeypatch.setattr(Path, "iterdir", forbidden)  # root may look into every process
    assert {finding.level for finding in imu.check(context)} == {Severity.OK}


def test_a_bus_that_the_daemon_reads_is_not_searched(
    machine: Machine, write: Write, process: Callable[..., None], tmp_path: Path, clock: VirtualClock
) -> None:
    write("dev/i2c-1", "")
    process(7, "lcf-edge", "run", opened=(str(tmp_path / "dev/i2c-1"),))
    bus = Bus(clock, "mpu6050", resting())
    assert "MPU-6050" not in only(list(imu.check(machine(open_bus=bus.open)))).text
    assert bus.wire.transfers == 0


def test_a_setting_that_the_chip_does_not_have_says_so(machine: Machine, clock: VirtualClock, write: Write) -> None:
    write("dev/i2c-1", "")
    bus = Bus(clock, "bmi270", resting())

    def without_firmware(config: Config, clock: Clock) -> object:
        return chip_on(bus.open(1), config.imu.driver, settings=ImuSettings(firmware=Path("/no/such.fw")), clock=clock)

    found = only(list(imu.check(machine(Config(imu=Imu(driver="bmi270")), open_imu=without_firmware))))
    assert found.level is Severity.FAIL
    assert "/no/such.fw" in found.text
