"""Serial IMUs by the real driver, through a real terminal, and everything that goes wrong with them."""

import errno
import math
import os
import re
import termios
from collections.abc import Callable, Iterator
from itertools import islice, pairwise
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from drivers.device import Device, KeptOpen
from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    DeviceStalledError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from drivers.imu import bno08x_rvc, bno08x_uart, csv_line, witmotion, witmotion_ble, xsens
from drivers.imu.registry import protocols
from drivers.imu.serial_imu import (
    MAX_BYTES_PER_S,
    MAX_NOISE_BYTES,
    MAX_READS_PER_S,
    MAX_SAMPLES_PER_S,
    SerialImu,
    open_port,
)
from drivers.imu.serial_port import ports
from drivers.imu.settings import ImuSettings
from drivers.samples import ImuSample
from hil_mocks.serial_imu import (
    ENCODERS,
    CsvEncoder,
    Encoder,
    Fault,
    RvcEncoder,
    SerialImuStandIn,
    XsensEncoder,
    cut_short,
    flipped_bits,
    garbage,
    mtdata2,
    silent,
    still,
    unplugged,
)

RATE_HZ = 100.0
MAX_READS = 40  # each ends after 0.1 s at the latest

Plug = Callable[..., SerialImuStandIn]
PROTOCOLS = protocols()
names = pytest.mark.parametrize("name", sorted(PROTOCOLS))


class TurnedClock:
    """Stands still but where a test turns it."""

    def __init__(self, now_ns: int = 1_000_000_000, step_ns: int = 0) -> None:
        self.now_ns = now_ns
        self.step_ns = step_ns  # with every look

    def monotonic_ns(self) -> int:
        self.now_ns += self.step_ns
        return self.now_ns

    def sleep_s(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)


def swinging(rate_hz: float = RATE_HZ) -> Iterator[ImuSample]:
    """An IMU that turns and shakes."""
    for number in range(1_000_000):
        swing = math.sin(2 * math.pi * number / rate_hz)
        yield ImuSample(round(number * 1e9 / rate_hz), (0.5 * swing, 0.2, -0.3 * swing), (swing, -0.5, 9.5))


@pytest.fixture
def plug(tmp_path: Path) -> Iterator[Plug]:
    """Plug a stand-in in; it vanishes with the test."""
    there: list[SerialImuStandIn] = []

    def plug_in(encoder: Encoder, faults: dict[int, Fault] | None = None) -> SerialImuStandIn:
        there.append(SerialImuStandIn(encoder, swinging(), tmp_path / f"usb-IMU-{len(there)}", faults))
        return there[-1]

    yield plug_in
    for stand_in in there:
        stand_in.close()


def opened(name: str, stand_in: SerialImuStandIn, clock: TurnedClock | None = None, baud: int = 0) -> Device[ImuSample]:
    device = open_port(name, stand_in.port, baud, ImuSettings(RATE_HZ), clock or TurnedClock())
    if name == "csv":
        stand_in.send_bytes(b"\n")  # the rest of a line that was begun before
    return device


def read(device: Device[ImuSample] | KeptOpen[ImuSample], count: int) -> list[ImuSample]:
    """Read until so many samples have come."""
    samples: list[ImuSample] = []
    for _ in range(MAX_READS):
        samples += device.read()
        if len(samples) >= count:
            break
    assert len(samples) >= count
    return samples


@names
def test_what_the_imu_measured_arrives(plug: Plug, name: str) -> None:
    stand_in = plug(ENCODERS[name]())
    device = opened(name, stand_in)

    stand_in.send(20)
    samples = read(device, 20 - (name == "bno08x_rvc"))

    truth = list(islice(swinging(), 20))
    if name == "bno08x_rvc":  # of the middle between two frames; the angles come in steps of 0.01°
        means = [tuple((p + q) / 2 for p, q in zip(a.gyro, b.gyro, strict=True)) for a, b in pairwise(truth)]
        assert np.array([sample.gyro for sample in samples]) == pytest.approx(np.array(means), abs=0.03)
    else:
        gyro = np.array([sample.gyro for sample in samples])
        assert gyro == pytest.approx(np.array([sample.gyro for sample in truth]), abs=2e-3)
        accel = np.array([sample.accel for sample in samples])
        assert accel == pytest.approx(np.array([sample.accel for sample in truth]), abs=5e-3)
    assert not any(sample.saturated for sample in samples)
    assert not +device.counts
    device.close()


@names
def test_stamps_are_as_steady_as_the_imu(plug: Plug, name: str) -> None:
    """Samples arrive in bursts of 1 to 8; what they were stamped with is their own rate."""
    stand_in = plug(ENCODERS[name]())
    clock = TurnedClock()
    device = opened(name, stand_in, clock)
    begin_ns = clock.now_ns
    rng = np.random.default_rng(1)
    samples: list[ImuSample] = []
    while stand_in.sent < 400:
        burst = int(rng.integers(1, 9))
        stand_in.send(burst)
        clock.now_ns = begin_ns + round((stand_in.sent - 1) / RATE_HZ * 1e9) + int(rng.integers(0, 2_000_000))
        samples += read(device, burst - (not samples and name == "bno08x_rvc"))

    settled = np.array([sample.stamp_ns for sample in samples])[-200:]
    assert np.diff(settled) == pytest.approx(1e9 / RATE_HZ, rel=0.01)
    made_ns = begin_ns + (np.arange(stand_in.sent)[-200:] - 0.5 * (name == "bno08x_rvc")) / RATE_HZ * 1e9
    assert np.all(np.abs(settled - made_ns) < 2e6)
    device.close()


@names
@pytest.mark.parametrize(
    "fault",
    [garbage(300), flipped_bits(1), cut_short(0.4), silent],
    ids=["garbage", "flipped bit", "cut short", "silent"],
)
def test_one_damaged_sample_costs_two_at_most(plug: Plug, name: str, fault: Fault) -> None:
    stand_in = plug(ENCODERS[name](), {10: fault})
    device = opened(name, stand_in)

    stand_in.send(40)
    samples = read(device, 40 - 1 - 2)

    assert all(max(map(abs, sample.gyro)) < 1 for sample in samples)
    device.close()


@names
def test_a_stall_is_told_apart_from_an_unplugged_imu(plug: Plug, name: str) -> None:
    stand_in = plug(ENCODERS[name]())
    clock = TurnedClock()
    device = opened(name, stand_in, clock)
    stand_in.send(5)
    read(device, 5 - (name == "bno08x_rvc"))
    clock.step_ns = 400_000_000

    with pytest.raises(DeviceStalledError, match=r"silent for .* check its power"):
        read(device, 1)
    device.close()


def test_a_board_that_starts_anew_when_its_port_is_opened_is_waited_for(plug: Plug) -> None:
    stand_in = plug(CsvEncoder())
    clock = TurnedClock()
    device = opened("csv", stand_in, clock)
    clock.now_ns += 3_000_000_000

    assert device.read() == []
    stand_in.send(3)
    assert len(read(device, 3)) == 3
    device.close()


@names
def test_hanging_up_is_a_lost_device(plug: Plug, name: str) -> None:
    stand_in = plug(ENCODERS[name]())
    device = opened(name, stand_in)
    stand_in.send(5)
    read(device, 4)

    stand_in.unplug()

    with pytest.raises(DeviceLostError, match=f"{stand_in.port}: the serial port went away"):
        read(device, 1)
    device.close()


@names
def test_back_after_a_replug_under_the_same_name(plug: Plug, name: str) -> None:
    stand_in = plug(ENCODERS[name]())
    clock = TurnedClock()
    kept = KeptOpen("imu", lambda: opened(name, stand_in, clock), clock)
    assert kept.read() == []  # opens
    stand_in.send(5)
    before = read(kept, 4)
    first_terminal = Path(stand_in.port).resolve()

    stand_in.unplug()
    for _ in range(4):
        assert kept.read() == []
    assert isinstance(kept.error, DeviceMissingError)
    something_else = os.openpty()  # takes the number that has become free
    stand_in.plug()
    assert Path(stand_in.port).resolve() != first_terminal
    away_ns = clock.now_ns
    assert kept.read() == []  # opens again, at the first attempt
    assert clock.now_ns - away_ns < 2_000_000_000
    stand_in.send(5)
    after = read(kept, 4)

    assert kept.error is None
    assert kept.counts["opened"] == 2
    assert after[0].stamp_ns > before[-1].stamp_ns
    kept.close()
    for end in something_else:
        os.close(end)


def test_an_imu_that_is_pulled_out_while_it_sends(plug: Plug) -> None:
    stand_in = plug(XsensEncoder(), {5: unplugged, 6: unplugged})
    clock = TurnedClock()
    kept = KeptOpen("imu", lambda: opened("xsens", stand_in, clock), clock)
    kept.read()
    for _ in range(6):
        stand_in.send()
        kept.read()
    assert kept.error is not None

    stand_in.send()  # still out
    stand_in.send()  # plugged in again
    for _ in range(3):
        kept.read()
    stand_in.send(3)

    assert len(read(kept, 3)) == 3


def pseudo_terminals_have(baud: int) -> bool:
    """Whether one can be set to it, and then says so."""
    speed = getattr(termios, f"B{baud}")
    leader, follower = os.openpty()
    try:
        attributes = termios.tcgetattr(follower)
        attributes[4:6] = speed, speed
        termios.tcsetattr(follower, termios.TCSANOW, attributes)
        return termios.tcgetattr(follower)[4:6] == [speed, speed]
    except termios.error:
        return False
    finally:
        os.close(leader)
        os.close(follower)


@pytest.mark.parametrize(
    ("name", "baud"),
    [
        (name, baud)
        for name in sorted(PROTOCOLS)
        for baud in (9600, 57600, 230400, 921600)
        if baud != ENCODERS[name]().baud
    ],
)
def test_a_wrong_baud_rate_is_recognised(plug: Plug, name: str, baud: int) -> None:
    if not pseudo_terminals_have(baud):
        pytest.skip(f"pseudo-terminals have no {baud} baud here, as under an emulator of another processor")
    stand_in = plug(ENCODERS[name]())
    device = opened(name, stand_in, baud=baud)

    def all_that_is_heard() -> None:
        for _ in range(MAX_NOISE_BYTES):  # one byte at least in each read
            stand_in.send(5)
            device.read()

    usual = re.escape(", ".join(map(str, PROTOCOLS[name].bauds)))
    with pytest.raises(WrongDeviceError, match=rf"{baud} baud and no valid frame; usual are {usual}: set imu\.baud"):
        all_that_is_heard()
    device.close()


@pytest.mark.parametrize(
    ("name", "frame", "needs"),
    [
        ("witmotion", bytes([0x55, 0x53, *bytes(8), 0xA8]), "acceleration and angular velocity"),
        ("xsens", mtdata2(b"\x10\x20\x02\x00\x00"), "RateOfTurn and Acceleration"),
        ("csv", b"roll 1.0 pitch 2.0 yaw 3.0\n", "lines of time_us,gx,gy,gz,ax,ay,az"),
    ],
)
def test_an_imu_that_does_not_send_what_is_needed_is_told_so(plug: Plug, name: str, frame: bytes, needs: str) -> None:
    stand_in = plug(ENCODERS[name]())
    device = opened(name, stand_in)

    def all_that_is_heard() -> None:
        for _ in range(MAX_NOISE_BYTES):
            stand_in.send_bytes(frame * 20)
            device.read()

    with pytest.raises(WrongDeviceError, match=f"make it send {needs}"):
        all_that_is_heard()
    device.close()


@pytest.mark.parametrize("encoder", [XsensEncoder(), CsvEncoder()], ids=["xsens", "csv"])
def test_a_device_clock_that_begins_anew_is_counted_and_time_goes_on(plug: Plug, encoder: Encoder) -> None:
    name = "xsens" if isinstance(encoder, XsensEncoder) else "csv"
    stand_in = plug(encoder)
    clock = TurnedClock()
    device = opened(name, stand_in, clock)
    samples: list[ImuSample] = []
    for sample in [*islice(still(100, start_ns=77_000_000_000), 10), *islice(still(100), 10)]:
        clock.now_ns += 10_000_000
        stand_in.send_bytes(encoder(sample))
        samples += read(device, 1)

    assert device.counts["restarted"] == 1
    assert all(later.stamp_ns > earlier.stamp_ns for earlier, later in pairwise(samples))
    device.close()


def test_a_device_clock_goes_on_over_its_end(plug: Plug) -> None:
    encoder = CsvEncoder()
    stand_in = plug(encoder)
    clock = TurnedClock()
    device = opened("csv", stand_in, clock)
    for sample in islice(still(100, start_ns=2**32 * 1000 - 50_000_000), 10):
        clock.now_ns += 10_000_000
        stand_in.send_bytes(encoder(sample))
        read(device, 1)

    assert not +device.counts
    device.close()


@pytest.mark.parametrize("wrap", [2**32, 864_000_000])
def test_an_xsens_clock_goes_on_over_the_end_of_its_series(plug: Plug, wrap: int) -> None:
    encoder = XsensEncoder(wrap=wrap)
    stand_in = plug(encoder)
    clock = TurnedClock()
    device = opened("xsens", stand_in, clock)
    for sample in islice(still(100, start_ns=wrap * 100_000 - 50_000_000), 10):
        clock.now_ns += 10_000_000
        stand_in.send_bytes(encoder(sample))
        read(device, 1)

    assert not +device.counts
    device.close()


@pytest.mark.parametrize(("name", "encoder"), [("csv", CsvEncoder()), ("xsens", XsensEncoder())])
def test_an_imu_with_2_khz_loses_nothing(plug: Plug, name: str, encoder: Encoder) -> None:
    stand_in, clock = plug(encoder), TurnedClock()
    device = opened(name, stand_in, clock)
    received = 0
    for _ in range(3 * 200):
        stand_in.send(10)
        clock.now_ns += 5_000_000
        received += len(read(device, 10))
    assert received == stand_in.sent
    assert not +device.counts


def test_a_line_that_is_faster_may_carry_more(plug: Plug) -> None:
    stand_in, clock = plug(ENCODERS["bno08x_uart"]()), TurnedClock()
    device = opened("bno08x_uart", stand_in, clock)
    for _ in range(200):
        stand_in.send(50)  # 320 kB a second
        clock.now_ns += 5_000_000
        read(device, 1)
    assert not device.counts["excess_bytes"]


def test_more_bytes_than_any_imu_sends_are_dropped_and_counted(plug: Plug) -> None:
    stand_in, clock = plug(CsvEncoder()), TurnedClock()  # the clock stands still, but for pauses
    device = opened("csv", stand_in, clock)
    begun_ns, sent = clock.now_ns, 1
    line = b"0,0,0,0,0,0" + b" " * 88 + b"\n"
    while sent < 2 * MAX_BYTES_PER_S:
        stand_in.send_bytes(line * 40)
        sent += 40 * len(line)
        device.read()
    parsed, paused_s = sent - device.counts["excess_bytes"], (clock.now_ns - begun_ns) / 1e9
    assert paused_s > 0.2
    assert parsed == pytest.approx(MAX_BYTES_PER_S * (1 + paused_s), rel=0.02)


def test_more_samples_than_any_imu_makes_are_dropped_and_counted(plug: Plug) -> None:
    stand_in, clock = plug(CsvEncoder()), TurnedClock()
    device = opened("csv", stand_in, clock)
    samples: list[ImuSample] = []
    for _ in range(200):
        stand_in.send_bytes(b"0,0,0,0,0,0\n" * 20)
        clock.now_ns += 2_000_000  # 10,000 a second
        samples += device.read()
    assert len(samples) == pytest.approx(1.4 * MAX_SAMPLES_PER_S, abs=20)
    assert device.counts == {"excess_samples": 4000 - len(samples)}


def test_small_pieces_are_read_together(plug: Plug) -> None:
    stand_in, clock = plug(CsvEncoder()), TurnedClock()
    device = opened("csv", stand_in, clock)
    begun_ns = clock.now_ns
    for byte in b"0,0,0,0,0,0\n" * 100:
        stand_in.send_bytes(bytes([byte]))
        device.read()
    paused_s = (clock.now_ns - begun_ns) / 1e9
    assert paused_s >= (1200 - 1) / MAX_READS_PER_S - 1


def test_rates_of_angles_are_in_seconds_of_the_vehicle(plug: Plug) -> None:
    """A BNO08x whose clock runs 3 % slow sends 97 frames a second; its turns are still right."""
    stand_in = plug(RvcEncoder())
    clock = TurnedClock()
    device = opened("bno08x_rvc", stand_in, clock)
    encoder = RvcEncoder()
    samples: list[ImuSample] = []
    for number in range(300):
        clock.now_ns += round(1e9 / 97)
        stand_in.send_bytes(encoder(ImuSample(round(number * 1e9 / 97), (0.0, 0.0, 0.5), (0.0, 0.0, 9.8))))
        samples += device.read()

    assert np.mean([sample.gyro[2] for sample in samples[-200:]]) == pytest.approx(0.5, rel=3e-3)
    device.close()


def test_an_open_port_is_busy_for_others(plug: Plug) -> None:
    stand_in = plug(XsensEncoder())
    device = opened("xsens", stand_in)

    with pytest.raises(DeviceBusyError, match="another program has it open") as busy:
        opened("xsens", stand_in)
    assert stand_in.port in str(busy.value)
    device.close()
    opened("xsens", stand_in).close()


def test_a_missing_port_names_those_that_are_there(tmp_path: Path) -> None:
    with pytest.raises(DeviceMissingError, match=r"no such serial port; there (are|is)") as missing:
        open_port("csv", str(tmp_path / "ttyUSB7"), 0, ImuSettings())
    assert missing.value.retry


def test_ports_with_a_lasting_name_come_first(tmp_path: Path) -> None:
    for name in ("ttyUSB1", "ttyUSB0", "ttyACM0", "tty1", "serial/by-id/usb-FTDI-if00"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()

    found = [str(Path(port).relative_to(tmp_path)) for port in ports(tmp_path)]

    assert found == ["serial/by-id/usb-FTDI-if00", "ttyUSB0", "ttyUSB1", "ttyACM0"]


def test_no_permission_names_the_group(plug: Plug) -> None:
    stand_in = plug(XsensEncoder())
    terminal = Path(stand_in.port).resolve()
    terminal.chmod(0)
    privileged = os.geteuid() == 0
    if privileged:
        os.seteuid(65534)  # nobody
    try:
        with pytest.raises(DeviceForbiddenError, match="group dialout"):
            open_port("xsens", str(terminal), 0, ImuSettings())
    finally:
        if privileged:
            os.seteuid(0)


def test_a_port_that_the_services_unit_leaves_out_is_no_matter_of_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused_by_the_device_policy(*_: object, **__: object) -> None:
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr("drivers.imu.serial_port.serial.Serial", refused_by_the_device_policy)
    with pytest.raises(DeviceForbiddenError, match=r"^/dev/ttyTHS1: the service may not open it; allow"):
        open_port("xsens", "/dev/ttyTHS1", 0, ImuSettings())


def test_a_file_is_no_serial_port(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()

    for path in (tmp_path, tmp_path / "notes.txt"):
        with pytest.raises(WrongDeviceError, match="is not a serial port"):
            open_port("csv", str(path), 0, ImuSettings())


def test_a_baud_rate_that_no_port_can_do(plug: Plug) -> None:
    with pytest.raises(UnsupportedSettingError, match="cannot do -1 baud"):
        open_port("csv", plug(CsvEncoder()).port, -1, ImuSettings())


@names
def test_closing_twice_is_no_matter(plug: Plug, name: str) -> None:
    stand_in = plug(ENCODERS[name]())
    device = opened(name, stand_in)
    stand_in.unplug()

    device.close()
    device.close()


def test_the_usual_baud_rate_is_the_one_the_makers_ship_or_recommend() -> None:
    assert {name: protocol.bauds[0] for name, protocol in PROTOCOLS.items()} == {
        **dict.fromkeys(PROTOCOLS, 115200),
        "bno08x_uart": 3_000_000,
    }


@pytest.mark.parametrize("module", [witmotion, witmotion_ble, bno08x_rvc, bno08x_uart, xsens, csv_line])
def test_run_by_hand(
    plug: Plug, module: ModuleType, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.by_hand.REPORT_NS", 200_000_000)
    stand_in = plug(ENCODERS[module.PROTOCOL.name]())
    stand_in.play()

    assert module.main(["--port", stand_in.port, "--rate", "100", "--seconds", "0.5"]) == 0

    assert re.search(r"\d Hz.* rad/s", capsys.readouterr().out)


def test_run_by_hand_without_an_imu(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert xsens.main(["--port", str(tmp_path / "none")]) == 1

    said = capsys.readouterr()
    assert not said.out
    assert said.err.count("\n") == 1


def test_serial_imu_is_a_device(plug: Plug) -> None:
    device: Device[ImuSample] = SerialImu(PROTOCOLS["csv"], plug(CsvEncoder()).port)

    assert device.name.startswith("csv at ")
    device.close()
