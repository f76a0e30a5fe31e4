"""QMI8658: what is its own among the I2C chips."""

from collections.abc import Callable
from typing import Any

import pytest

from drivers.errors import DeviceLostError

RigMaker = Callable[..., Any]


def test_data_are_locked_while_they_are_read(rig: RigMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = rig("qmi8658", motion=lambda _: ((0.1, 0.2, 0.3), (0.0, 0.0, 9.8)))
    assert bench.read_for(0.2)[-1].gyro[2] == pytest.approx(0.3, abs=0.001)
    monkeypatch.setattr("drivers.imu.qmi8658.AHB_CLOCK_GATING", 0x10)
    unlocked = rig("qmi8658", motion=lambda _: ((0.1, 0.2, 0.3), (0.0, 0.0, 9.8)))
    assert unlocked.read_for(0.2)[-1].gyro[2] != pytest.approx(0.3, abs=0.1)


def test_a_burst_that_failed_halfway_leaves_nothing_locked(rig: RigMaker) -> None:
    bench = rig("qmi8658")
    bench.read_for(1)
    bench.clock.sleep_s(0.005)
    bench.chip.read(0x2D, 1)  # and no more
    assert len(bench.read_for(1)) == pytest.approx(bench.device.rate_hz, abs=3)


def test_samples_that_nobody_read_in_time_are_counted_and_left_out_of_the_stamps(rig: RigMaker) -> None:
    bench = rig("qmi8658")
    bench.read_for(2)
    bench.clock.sleep_s(0.1)
    samples = bench.read_for(0.5)
    assert bench.device.counts["lost"] == pytest.approx(0.1 * bench.device.rate_hz - 1, abs=1)
    for sample in samples:
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.003)


def test_a_qmi8658c_samples_5_percent_faster(rig: RigMaker) -> None:
    bench = rig("qmi8658", rate_error=0.94 / 0.8968 - 1)
    samples = [sample for sample in bench.read_for(4) if sample.stamp_ns > bench.began_ns + 2e9]
    seconds = (samples[-1].stamp_ns - samples[0].stamp_ns) / 1e9
    assert (len(samples) - 1) / seconds == pytest.approx(0.94 * 250, rel=0.005)
    assert bench.device.counts["lost"] <= 4  # until its rate is known
    for sample in samples:
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.003)


def test_numbers_go_on_from_0_after_2_to_the_24(rig: RigMaker) -> None:
    bench = rig("qmi8658")
    bench.read_for(1)
    bench.chip._number = 2**24 - 20
    bench.read_for(0.05)
    bench.device.counts.clear()
    assert len(bench.read_for(1)) == pytest.approx(bench.device.rate_hz, abs=2)
    assert not +bench.device.counts


def test_a_reset_that_never_ends_is_reported(rig: RigMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil_mocks.i2c.qmi8658.Qmi8658.boot_ns", 10**10)
    with pytest.raises(DeviceLostError, match="does not come back from a reset; switch its supply off and on"):
        rig("qmi8658").open()


def test_a_reset_may_take_as_long_as_the_data_sheet_of_the_c_says(
    rig: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hil_mocks.i2c.qmi8658.Qmi8658.boot_ns", 1_750_000_000)
    assert rig("qmi8658").read_for(2.5)


def test_a_command_that_is_never_done_is_reported(rig: RigMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil_mocks.i2c.qmi8658.COMMAND_NS", 10**10)
    with pytest.raises(DeviceLostError, match="does not execute a command; switch its supply off and on"):
        rig("qmi8658").open()
