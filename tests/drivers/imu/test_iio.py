"""The kernel's IIO devices, played by files of the same names and contents, and a pipe for the character device."""

import errno
import math
import os
import struct
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    DeviceStalledError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from drivers.imu import iio
from drivers.imu.iio import Iio
from drivers.imu.iio_sysfs import driver_error
from drivers.imu.settings import ImuSettings
from hil_mocks.virtual_clock import VirtualClock

GYRO_SCALE, ACCEL_SCALE = 0.000266181, 0.001197101

MPU6050 = {  # as inv_mpu6050 shows it
    "name": "mpu6050",
    "sampling_frequency": "50",
    "sampling_frequency_available": "10 20 50 100 200 500",
    "in_anglvel_scale": "0.001064724",
    "in_anglvel_scale_available": "0.000133090 0.000266181 0.000532362 0.001064724",
    "in_accel_scale": "0.000598",
    "in_accel_scale_available": "0.000598550 0.001197101 0.002394202 0.004788403",
    "in_temp_raw": "-3420",
    "in_temp_offset": "12420",
    "in_temp_scale": "2.941176",
    **{f"in_anglvel_{axis}_raw": str(1000 * (n + 1)) for n, axis in enumerate("xyz")},
    **{f"in_accel_{axis}_raw": str(-2000 * (n + 1)) for n, axis in enumerate("xyz")},
}
CHANNELS = ("in_accel_x", "in_accel_y", "in_accel_z", "in_temp", "in_anglvel_x", "in_anglvel_y", "in_anglvel_z")
BUFFER = {
    "buffer/enable": "0",
    "buffer/length": "2",
    "buffer/watermark": "1",
    "trigger/current_trigger": "mpu6050-dev0",
    "current_timestamp_clock": "realtime\n",
    **{f"scan_elements/{name}_en": "1" for name in CHANNELS},
    **{f"scan_elements/{name}_index": str(index) for index, name in enumerate(CHANNELS)},
    **{f"scan_elements/{name}_type": "be:s16/16>>0" for name in CHANNELS},
    "scan_elements/in_timestamp_en": "0",
    "scan_elements/in_timestamp_index": "7",
    "scan_elements/in_timestamp_type": "le:s64/64>>0",
}

Tree = Callable[..., Path]


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    """Adds a device to the folder that it answers with."""

    def add(folder: str = "iio:device0", **more: dict[str, str]) -> Path:
        for attribute, text in ({**MPU6050, **more.get("files", {})}).items():
            path = tmp_path / folder / attribute
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return tmp_path

    return add


def text(root: Path, attribute: str) -> str:
    return (root / "iio:device0" / attribute).read_text()


# Polled.


def polled(root: Path, clock: VirtualClock, device: str = "", settings: ImuSettings | None = None) -> Iio:
    return Iio(device, settings or ImuSettings(), root, root / "dev", clock)


def test_polled_values_are_scaled_to_si(tree: Tree) -> None:
    clock = VirtualClock()
    device = polled(tree(), clock)
    (sample,) = device.read()
    assert sample.gyro == pytest.approx([n * 1000 * GYRO_SCALE for n in (1, 2, 3)])
    assert sample.accel == pytest.approx([n * -2000 * ACCEL_SCALE for n in (1, 2, 3)])
    assert sample.stamp_ns == clock.monotonic_ns()
    assert device.name == "mpu6050 (iio:device0)"
    assert device.temperature_c == pytest.approx((-3420 + 12420) * 2.941176 / 1000)
    device.close()
    device.close()


def test_polled_at_the_rate_that_was_granted(tree: Tree) -> None:
    clock = VirtualClock()
    device = polled(tree(), clock, settings=ImuSettings(rate_hz=180))
    assert device.rate_hz == 200
    stamps_ns = [sample.stamp_ns for _ in range(5) for sample in device.read()]
    assert {later - earlier for earlier, later in pairwise(stamps_ns)} == {5_000_000}
    device.close()


def test_polled_values_change_with_the_files(tree: Tree) -> None:
    root = tree()
    device = polled(root, VirtualClock())
    device.read()
    (root / "iio:device0/in_anglvel_y_raw").write_text("-32768\n")
    (sample,) = device.read()
    assert sample.gyro[1] == pytest.approx(-32768 * GYRO_SCALE)
    assert sample.saturated
    device.close()


def test_offset_is_added_before_scaling(tree: Tree) -> None:
    device = polled(tree(files={"in_accel_offset": "500", "in_anglvel_x_offset": "-100"}), VirtualClock())
    (sample,) = device.read()
    assert sample.accel[0] == pytest.approx(-1500 * ACCEL_SCALE)
    assert sample.gyro[:2] == pytest.approx((900 * GYRO_SCALE, 2000 * GYRO_SCALE))
    device.close()


@pytest.mark.parametrize(
    ("settings", "rate", "gyro", "accel"),
    [
        (ImuSettings(), "200", "0.000266181", "0.001197101"),
        (ImuSettings(1000, 2000, 16), "500", "0.001064724", "0.004788403"),
        (ImuSettings(10, 250, 2), "10", "0.000133090", "0.000598"),
    ],
)
def test_rate_and_ranges_are_set_to_the_closest_on_offer(
    tree: Tree, settings: ImuSettings, rate: str, gyro: str, accel: str
) -> None:
    root = tree()
    polled(root, VirtualClock(), settings=settings).close()
    assert text(root, "sampling_frequency") == rate
    assert text(root, "in_anglvel_scale") == gyro
    assert float(text(root, "in_accel_scale")) == pytest.approx(float(accel), rel=1e-3)


def test_a_range_of_rates_is_kept_to(tree: Tree) -> None:
    root = tree(files={"sampling_frequency_available": "[1 1 100]"})
    assert polled(root, VirtualClock()).rate_hz == 100


@pytest.mark.parametrize(("chip", "joint"), [("lsm6dso", "_"), ("icm42688", "-"), ("icm45686", "-")])
def test_gyro_and_accelerometer_may_be_two_devices(tree: Tree, chip: str, joint: str) -> None:
    gyro = {name: value for name, value in MPU6050.items() if "accel" not in name}
    root = tree()
    for path in (root / "iio:device0").glob("in_accel*"):
        path.unlink()
    (root / "iio:device0/name").write_text(f"{chip}{joint}gyro\n")
    tree("iio:device1", files={"name": f"{chip}{joint}accel"})
    for name in gyro:
        if "anglvel" in name:
            (root / "iio:device1" / name).unlink()
    device = polled(root, VirtualClock(), chip)
    (sample,) = device.read()
    assert sample.accel[0] == pytest.approx(-2000 * ACCEL_SCALE)
    device.close()


@pytest.mark.parametrize("device", ["", "bmi160", "iio:device3"])
def test_a_device_is_found_by_name_by_folder_or_by_its_gyro(tree: Tree, device: str) -> None:
    root = tree("iio:device3", files={"name": "bmi160\n"})
    (root / "iio:device0").mkdir()
    (root / "iio:device0/name").write_text("bme280\n")
    assert polled(root, VirtualClock(), device).name == "bmi160 (iio:device3)"


def test_a_missing_device_is_reported_with_those_that_are_there(tree: Tree) -> None:
    root = tree()
    with pytest.raises(DeviceMissingError, match=r"bmi160: no such device under .*; there is mpu6050 \(iio:device0\)"):
        polled(root, VirtualClock(), "bmi160")


def test_no_device_at_all_is_reported(tmp_path: Path) -> None:
    with pytest.raises(DeviceMissingError, match="there is no gyro at all; is the kernel's driver loaded"):
        polled(tmp_path, VirtualClock())


def test_a_gyro_alone_is_reported(tree: Tree) -> None:
    root = tree()
    (root / "iio:device0/in_accel_x_raw").unlink()
    with pytest.raises(WrongDeviceError, match="has no accelerometer"):
        polled(root, VirtualClock())


@pytest.mark.parametrize(
    ("files", "error"),
    [
        ({"in_anglvel_scale": "loud"}, WrongDeviceError),
        ({"sampling_frequency_available": "fast faster"}, WrongDeviceError),
        ({"sampling_frequency": "0", "sampling_frequency_available": "0"}, UnsupportedSettingError),
        ({"sampling_frequency": "\xff\xfe"}, WrongDeviceError),
    ],
)
def test_attributes_that_make_no_sense_are_reported(tree: Tree, files: dict[str, str], error: type[Exception]) -> None:
    root = tree(files=files)
    with pytest.raises(error):
        polled(root, VirtualClock())


def test_polled_values_that_cannot_be_read_are_counted_then_given_up(tree: Tree) -> None:
    root = tree()
    device = polled(root, VirtualClock())
    (root / "iio:device0/in_accel_z_raw").write_text("")
    for _ in range(9):
        assert device.read() == []
    assert device.counts["io_error"] == 9
    with pytest.raises(DeviceLostError):
        device.read()
    device.close()


@pytest.mark.parametrize(
    ("number", "error"),
    [
        (errno.EACCES, DeviceForbiddenError),
        (errno.EPERM, DeviceForbiddenError),
        (errno.EBUSY, DeviceBusyError),
        (errno.ENODEV, DeviceLostError),
        (errno.EIO, DeviceLostError),
    ],
)
def test_what_the_kernel_says_becomes_a_typed_error(number: int, error: type[Exception]) -> None:
    said = driver_error(OSError(number, os.strerror(number)), Path("/sys/x"))
    assert type(said) is error
    assert "\n" not in str(said)


# Buffered.


class Pipe:
    """The character device: what is written to it comes out whole or in parts."""

    def __init__(self, node: Path) -> None:
        node.parent.mkdir()
        os.mkfifo(node)
        self._file = os.open(node, os.O_RDWR | os.O_NONBLOCK)

    def write(self, data: bytes) -> None:
        os.write(self._file, data)

    def hang_up(self) -> None:
        os.close(self._file)
        self._file = -1

    def close(self) -> None:
        if self._file >= 0:
            os.close(self._file)


@pytest.fixture
def pipe(tmp_path: Path) -> Iterator[Pipe]:
    pipe = Pipe(tmp_path / "dev/iio:device0")
    yield pipe
    pipe.close()


def scan(stamp_ns: int, gyro: tuple[int, int, int] = (1, 2, 3), accel: tuple[int, int, int] = (4, 5, 6)) -> bytes:
    """in_temp is switched off; the stamp is aligned to 8 bytes."""
    return struct.pack(">6h4x", *accel, *gyro) + struct.pack("<q", stamp_ns)


def buffered(root: Path) -> Iio:
    return Iio("", ImuSettings(), root, root / "dev", VirtualClock())


def test_scans_come_with_the_kernels_stamps(tree: Tree, pipe: Pipe) -> None:
    device = buffered(tree(files=BUFFER))
    pipe.write(scan(1_000) + scan(6_000, gyro=(-1, 32767, 0)))
    first, second = device.read()
    assert (first.stamp_ns, second.stamp_ns) == (1_000, 6_000)
    assert first.gyro == pytest.approx((GYRO_SCALE, 2 * GYRO_SCALE, 3 * GYRO_SCALE))
    assert first.accel == pytest.approx((4 * ACCEL_SCALE, 5 * ACCEL_SCALE, 6 * ACCEL_SCALE))
    assert (first.saturated, second.saturated) == (False, True)
    device.close()


@pytest.mark.usefixtures("pipe")
def test_the_buffer_is_set_up_and_left_switched_off(tree: Tree) -> None:
    root = tree(files=BUFFER)
    device = buffered(root)
    assert text(root, "buffer/enable") == "1"
    assert text(root, "current_timestamp_clock") == "monotonic"
    assert text(root, "scan_elements/in_temp_en") == "0"
    assert text(root, "scan_elements/in_timestamp_en") == "1"
    assert text(root, "scan_elements/in_anglvel_z_en") == "1"
    assert text(root, "buffer/watermark") == "3"
    device.close()
    device.close()
    assert text(root, "buffer/enable") == "0"


def test_a_buffer_that_a_killed_program_left_on_is_taken_over(tree: Tree, pipe: Pipe) -> None:
    device = buffered(tree(files={**BUFFER, "buffer/enable": "1"}))
    pipe.write(scan(1))
    assert len(device.read()) == 1
    device.close()


def test_a_scan_that_comes_in_parts_is_put_together(tree: Tree, pipe: Pipe) -> None:
    device = buffered(tree(files=BUFFER))
    data = b"".join(scan(stamp_ns) for stamp_ns in range(1, 6))
    stamps_ns = []
    for begin in range(0, len(data), 10):
        pipe.write(data[begin : begin + 10])
        stamps_ns += [sample.stamp_ns for sample in device.read()]
    assert stamps_ns == [1, 2, 3, 4, 5]
    device.close()


@given(data=st.binary(max_size=600), cuts=st.lists(st.integers(0, 600), max_size=6))
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_in_any_parts_are_samples_and_nothing_piles_up(
    tree: Tree, pipe: Pipe, data: bytes, cuts: list[int]
) -> None:
    device = buffered(tree(files=BUFFER))
    got = 0
    for begin, end in pairwise(sorted({0, len(data), *(cut for cut in cuts if cut < len(data))})):
        pipe.write(data[begin:end])
        got += len(device.read())
        assert len(device._source._rest) < 24  # type: ignore[union-attr]
    assert got == len(data) // 24
    device.close()


def test_words_in_the_middle_of_their_storage_keep_their_sign(tree: Tree, pipe: Pipe) -> None:
    files = {**BUFFER, "in_anglvel_offset": "0"}
    files |= {f"scan_elements/in_anglvel_{axis}_type": "le:s20/32>>8" for axis in "xyz"}
    device = buffered(tree(files=files))
    words = [(count << 8 | 0xF0000055) & 0xFFFFFFFF for count in (-1 & 0xFFFFF, 0x7FFFF, 1)]
    pipe.write(struct.pack(">3h2x", 4, 5, 6) + struct.pack("<3I4x", *words) + struct.pack("<q", 7))
    (sample,) = device.read()
    scale = float(text(Path(device._folder).parent, "in_anglvel_scale"))
    assert sample.gyro == pytest.approx((-scale, 0x7FFFF * scale, scale))
    assert sample.stamp_ns == 7
    assert sample.saturated
    device.close()


@pytest.mark.parametrize("kind", ["be:s16/16", "be:s16/16X1", "be:s16/16X1>>0"])
def test_a_type_may_leave_out_repeat_and_shift(tree: Tree, pipe: Pipe, kind: str) -> None:
    device = buffered(tree(files={**BUFFER, **{f"scan_elements/{name}_type": kind for name in CHANNELS}}))
    pipe.write(struct.pack(">6h4x", 4, 5, 6, 1, 2, 3) + struct.pack("<q", 7))
    (sample,) = device.read()
    assert (sample.stamp_ns, sample.saturated) == (7, False)
    device.close()


def test_without_monotonic_stamps_the_arrival_counts(tree: Tree, pipe: Pipe) -> None:
    files = {name: value for name, value in BUFFER.items() if "timestamp" not in name}
    device = buffered(tree(files=files))
    pipe.write(struct.pack(">6h", 4, 5, 6, 1, 2, 3) * 2)
    first, second = device.read()
    assert second.stamp_ns - first.stamp_ns == pytest.approx(5e6)
    assert second.stamp_ns == device._clock.monotonic_ns()
    device.close()


@pytest.mark.usefixtures("pipe")
def test_a_trigger_of_the_devices_own_is_set(tree: Tree) -> None:
    root = tree(files={**BUFFER, "trigger/current_trigger": "\n"})
    (root / "trigger0").mkdir()
    (root / "trigger0/name").write_text("mpu6050-dev0\n")
    buffered(root).close()
    assert text(root, "trigger/current_trigger") == "mpu6050-dev0"


@pytest.mark.usefixtures("pipe")
def test_without_any_trigger_the_values_are_polled(tree: Tree) -> None:
    root = tree(files={**BUFFER, "trigger/current_trigger": "", "buffer/enable": "1"})
    device = buffered(root)
    assert device.read()[0].gyro[0] == pytest.approx(1000 * GYRO_SCALE)
    assert text(root, "buffer/enable") == "0"
    device.close()


@pytest.mark.usefixtures("pipe")
def test_a_type_that_is_unknown_is_reported(tree: Tree) -> None:
    with pytest.raises(UnsupportedSettingError, match="in_accel_y has the unknown type be:f16/16>>0"):
        buffered(tree(files={**BUFFER, "scan_elements/in_accel_y_type": "be:f16/16>>0"}))


@pytest.mark.usefixtures("pipe")
def test_no_scans_are_reported_as_a_stall(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(iio, "STALL_S", 0.01)
    device = buffered(tree(files={**BUFFER, "sampling_frequency_available": "200"}))
    with pytest.raises(DeviceStalledError, match=r"no scan for 0\.05 s"):
        device.read()
    device.close()


def test_a_device_that_goes_is_lost(tree: Tree, pipe: Pipe) -> None:
    device = buffered(tree(files=BUFFER))
    pipe.hang_up()
    with pytest.raises(DeviceLostError, match="is gone"):
        device.read()
    device.close()


@pytest.mark.usefixtures("pipe")
def test_after_closing_it_must_be_opened_again(tree: Tree) -> None:
    device = buffered(tree(files=BUFFER))
    device.close()
    with pytest.raises(DeviceLostError, match="is closed"):
        device.read()


def test_by_hand_without_a_device_says_so_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert iio.main(["nosuch-imu"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("nosuch-imu: no such device under /sys/bus/iio/devices; ")
    assert said.count("\n") == 1


def test_half_a_turn_a_second_in_the_default_range(tree: Tree) -> None:
    counts = round(math.pi / GYRO_SCALE)
    device = polled(tree(files={"in_anglvel_z_raw": str(counts)}), VirtualClock())
    assert device.read()[0].gyro[2] == pytest.approx(math.pi, rel=1e-4)
    device.close()
