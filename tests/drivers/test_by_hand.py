"""Watching a device from the command line."""

from collections import Counter
from collections.abc import Sequence
from importlib import import_module

import pytest

from drivers.by_hand import describe_imu, watch
from drivers.errors import DeviceLostError, DeviceMissingError
from drivers.samples import ImuSample
from hil_mocks.virtual_clock import VirtualClock


class Steady:
    """100 Hz; fails or is interrupted when it is told to."""

    def __init__(self, clock: VirtualClock, ends_with: BaseException | None = None, rate_hz: float = 100.0) -> None:
        self.name = "steady"
        self.counts: Counter[str] = Counter()
        self.closed = False
        self._clock = clock
        self._ends_with = ends_with
        self._rate_hz = rate_hz

    def read(self) -> Sequence[ImuSample]:
        if self._ends_with and self._clock.monotonic_ns() > 1_001_500_000_000:
            raise self._ends_with
        if not self._rate_hz:
            self._clock.sleep_s(0.1)
            return []
        self._clock.sleep_s(1 / self._rate_hz)
        return [ImuSample(self._clock.monotonic_ns(), (0.0, 0.0, 1.0), (0.0, 0.0, 9.8))]

    def close(self) -> None:
        self.closed = True


def describe(sample: ImuSample) -> str:
    return f"turning {sample.gyro[2]}"


def test_a_line_a_second_with_rate_jitter_errors_and_values(capsys: pytest.CaptureFixture[str]) -> None:
    clock = VirtualClock()
    device = Steady(clock)
    device.counts.update(timeout=2, nack=1)
    assert watch(lambda: device, 2.5, describe, clock) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines == [" 100.00 Hz, every 10.00 to 10.00 ms  nack 1 timeout 2  turning 1.0"] * 2
    assert device.closed


def test_nothing_that_comes_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    clock = VirtualClock()
    assert watch(lambda: Steady(clock, rate_hz=0), 1.5, describe, clock) == 0
    assert capsys.readouterr().out == "steady: nothing came  no errors\n"


def test_a_device_that_cannot_be_opened_is_one_line_and_status_1(capsys: pytest.CaptureFixture[str]) -> None:
    def gone() -> Steady:
        raise DeviceMissingError("imu: no such device; plug it in")

    assert watch(gone, 1, describe, VirtualClock()) == 1
    assert capsys.readouterr() == ("", "imu: no such device; plug it in\n")


def test_a_device_that_fails_is_closed_and_reported(capsys: pytest.CaptureFixture[str]) -> None:
    clock = VirtualClock()
    device = Steady(clock, DeviceLostError("imu: gone"))
    assert watch(lambda: device, 9, describe, clock) == 1
    assert capsys.readouterr().err == "imu: gone\n"
    assert device.closed


def test_an_interrupt_ends_it_well(capsys: pytest.CaptureFixture[str]) -> None:
    clock = VirtualClock()
    device = Steady(clock, KeyboardInterrupt())
    assert watch(lambda: device, 9, describe, clock) == 0
    assert capsys.readouterr().err == ""
    assert device.closed


def test_values_of_a_sample_with_units_and_saturation() -> None:
    sample = ImuSample(0, (0.1, 0.2, -0.3), (0.0, 0.0, 9.8), saturated=True)
    line = "gyro  +0.1000  +0.2000  -0.3000 rad/s  accel   +0.000   +0.000   +9.800 m/s²  saturated"
    assert describe_imu(sample) == line


@pytest.mark.parametrize("number", ["0", "-1", "nan", "inf", "fast"])
@pytest.mark.parametrize(
    ("driver", "option"),
    [
        ("camera.v4l2", "--fps"),
        ("camera.libcamera", "--exposure-s"),
        ("imu.mpu6050", "--rate"),
        ("imu.iio", "--rate"),
        ("imu.xsens", "--seconds"),
    ],
)
def test_what_is_no_number_above_0_is_refused_before_a_device_is_opened(
    capsys: pytest.CaptureFixture[str], driver: str, option: str, number: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        import_module(f"drivers.{driver}").main([f"{option}={number}"])
    assert ended.value.code == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.endswith(f"error: argument {option}: {number}: write a number above 0")
