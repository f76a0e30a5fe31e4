"""EuRoC/ASL folders: what is delivered, and what becomes of every fault."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Camera, Config, Imu
from lcf_edge.errors import RecordingError
from lcf_edge.lens import Lens
from lcf_edge.recording.read import open_recording

Read = Callable[..., tuple[Any, list[Any]]]
FRAMES = [0, 50_000_000, 100_000_000, 150_000_000, 200_000_000]


def of(kind: type, items: list[Any]) -> list[Any]:
    return [item for item in items if isinstance(item, kind)]


def frames(items: list[Any]) -> list[int]:
    return [frame.stamp_ns for frame in of(Frame, items)]


@pytest.mark.parametrize("inside", ["", "mav0"])
def test_everything_is_delivered(asl: Any, read: Read, inside: str) -> None:
    recording, items = read(asl.path / inside)
    assert frames(items) == FRAMES
    assert [frame.seq for frame in of(Frame, items)] == [0, 1, 2, 3, 4]
    assert [int(frame.image.mean()) for frame in of(Frame, items)] == [5, 15, 25, 35, 45]
    assert {(frame.image.shape, frame.image.dtype) for frame in of(Frame, items)} == {((48, 64), np.dtype("u1"))}
    assert len(of(ImuSample, items)) == 26
    assert [(s.speed_mps, s.yaw_rate_radps) for s in of(SpeedSample, items)] == [(1.5, 0.25)] * 13
    assert recording.lens == Lens(64, 48, 50.0, 51.0, 31.5, 23.5, "radial-tangential", (-0.28, 0.07, 0.0002, 1.8e-05))
    assert (recording.frame_count, recording.has_imu, recording.has_speed) == (5, True, True)
    assert (recording.warnings, dict(recording.skipped)) == ([], {})


def test_samples_come_before_the_frame_that_needs_them(asl: Any, read: Read) -> None:
    _, items = read(asl.path)
    assert [type(item) for item in items[:3]] == [ImuSample, SpeedSample, Frame]
    place = items.index(of(Frame, items)[1])
    assert of(ImuSample, items[:place])[-1].stamp_ns == 50_000_000
    assert of(SpeedSample, items[:place])[-1].stamp_ns == 60_000_000, "the first one after it"


def test_reading_again_gives_the_same(asl: Any) -> None:
    asl.image_path(FRAMES[2]).unlink()
    recording = open_recording(asl.path, Config())
    first = [repr(item) for item in recording]
    warned = (list(recording.warnings), dict(recording.skipped))
    assert [repr(item) for item in recording] == first
    assert (recording.warnings, dict(recording.skipped)) == warned


def test_imu_is_turned_into_the_axes_of_the_camera(asl: Any, read: Read) -> None:
    """R_BC is a quarter turn about z, R_BI one about x: (x, y, z) → body (x, -z, y) → camera (-z, -x, y)."""
    _, items = read(asl.path)
    sample = of(ImuSample, items)[0]
    np.testing.assert_allclose(sample.gyro, (-0.3, -0.1, 0.2))
    np.testing.assert_allclose(sample.accel, (-3, -1, 2))


def test_configured_axes_replace_those_of_the_recording(asl: Any) -> None:
    """They are applied further on, to samples as they were recorded."""
    turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    items = list(open_recording(asl.path, Config(imu=Imu(axes=turn))))
    assert of(ImuSample, items)[0].gyro == (0.1, 0.2, 0.3)


@pytest.mark.parametrize("sensor", ["imu0", "odom0"])
@pytest.mark.parametrize("missing", ["folder", "data.csv", "rows"])
def test_without_imu_or_odometry(asl: Any, read: Read, sensor: str, missing: str) -> None:
    asl.csv(sensor).unlink()
    if missing == "folder":
        for file in asl.csv(sensor).parent.iterdir():
            file.unlink()
        asl.csv(sensor).parent.rmdir()
    elif missing == "rows":
        asl.write(sensor, "#timestamp [ns]", [])
    recording, items = read(asl.path)
    assert frames(items) == FRAMES
    assert (recording.has_imu, recording.has_speed) == (sensor != "imu0", sensor != "odom0")
    assert (not recording.warnings) == (missing == "folder")


def test_a_missing_calibration_is_reported(asl: Any) -> None:
    (asl.path / "mav0" / "cam0" / "sensor.yaml").unlink()
    recording = open_recording(asl.path, Config())
    assert recording.lens is None
    assert "camera.intrinsics" in recording.warnings[0]
    known = open_recording(asl.path, Config(camera=Camera(intrinsics=[50.0, 50.0, 32.0, 24.0])))
    assert known.warnings == []


def test_a_missing_mounting_of_the_imu_is_reported(asl: Any) -> None:
    (asl.path / "mav0" / "imu0" / "sensor.yaml").unlink()
    (warning,) = open_recording(asl.path, Config()).warnings
    assert "imu.axes" in warning


def test_a_broken_calibration_is_refused(asl: Any) -> None:
    asl.yaml("cam0", "resolution [64, 48]")
    with pytest.raises(RecordingError, match=r"cam0/sensor\.yaml:1: .*fix"):
        open_recording(asl.path, Config())


@pytest.mark.parametrize("sensor", ["cam0", "imu0", "odom0"])
@pytest.mark.parametrize(
    "row",
    ["garbage", "50000000", "x,y,z,1,2,3,4", "-5,1,2,3,4,5,6", "99999999999999999999,1,2,3,4,5,6", "\0,,,"],
)
def test_a_bad_row_is_skipped_counted_and_named(asl: Any, read: Read, sensor: str, row: str) -> None:
    asl.edit(sensor, 3, row)
    recording, items = read(asl.path)
    assert len(items) == 5 + 26 + 13 - 1
    ((reason, count),) = recording.skipped.items()
    assert (reason.split()[1:], count) == (["row", "malformed"], 1)
    (warning,) = recording.warnings
    assert warning.startswith(f"{asl.csv(sensor)}:3: ")
    assert "\n" not in warning


@pytest.mark.parametrize("name", ["../../secret.png", "/etc/hostname", "data/0.png", "\0.png"])
def test_a_name_that_no_image_in_the_folder_can_have_is_a_bad_row(asl: Any, read: Read, name: str) -> None:
    asl.edit("cam0", 3, f"50000000,{name}")
    recording, _ = read(asl.path)
    assert recording.skipped == {"image row malformed": 1}


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
@pytest.mark.parametrize(("sensor", "kind"), [("imu0", "imu"), ("odom0", "speed")])
def test_values_that_are_no_numbers_are_skipped_and_counted(
    asl: Any, read: Read, sensor: str, kind: str, value: str
) -> None:
    asl.edit(sensor, 4, f"40000001,{value},0.2,0.3,1,2,3")
    recording, _ = read(asl.path)
    assert recording.skipped == {f"{kind} row with NaN or inf": 1}


def test_an_unknown_yaw_rate_is_passed_on(asl: Any, read: Read) -> None:
    asl.edit("odom0", 2, "0,1.5,nan")
    recording, items = read(asl.path)
    assert math.isnan(of(SpeedSample, items)[0].yaw_rate_radps)
    assert not recording.skipped


@pytest.mark.parametrize("sensor", ["cam0", "imu0", "odom0"])
@pytest.mark.parametrize("stamp", [0, 10**18], ids=["back", "far ahead"])
def test_a_time_out_of_order_costs_its_own_row(asl: Any, read: Read, sensor: str, stamp: int) -> None:
    asl.edit(sensor, 4, f"{stamp},{FRAMES[2]}.png" if sensor == "cam0" else f"{stamp},0.1,0.2,0.3,1,2,3")
    recording, items = read(asl.path)
    assert len(items) == 5 + 26 + 13 - 1
    ((reason, count),) = recording.skipped.items()
    assert (reason.split(maxsplit=1)[1], count) == ("time that does not increase", 1)
    (warning,) = recording.warnings
    assert warning.startswith(f"{asl.csv(sensor)}:4: ")


def test_warnings_of_one_kind_end_and_the_count_goes_on(asl: Any, read: Read) -> None:
    for line in range(3, 23):
        asl.edit("imu0", line, "garbage")
    recording, _ = read(asl.path)
    assert recording.skipped == {"imu row malformed": 20}
    assert len(recording.warnings) == 5
    assert recording.warnings[-1].endswith("more of these are only counted")


def test_rows_without_numbers_at_all_and_very_long_ones(asl: Any, read: Read) -> None:
    asl.csv("imu0").write_bytes(b"\xef\xbb\xbftimestamp,w_x\r\n0,1,2,3,4,5,6\r\n\r\n" + b"7" * 20_000 + b"\n")
    recording, items = read(asl.path)
    assert len(of(ImuSample, items)) == 1
    assert recording.skipped == {"imu row malformed": 5}, "a row that long is read in pieces"


@pytest.mark.parametrize(
    ("fault", "reason"),
    [("missing", "missing"), ("empty", "empty"), ("cut", "damaged"), ("flipped", "damaged"),
     ("text", "of unknown format"), ("folder", "unreadable")],
)  # fmt: skip
def test_a_bad_image_is_skipped_and_the_rest_is_read(
    asl: Any, read: Read, capfd: pytest.CaptureFixture[str], fault: str, reason: str
) -> None:
    path = asl.image_path(FRAMES[2])
    data = path.read_bytes()
    path.unlink()
    if fault == "folder":
        path.mkdir()
    elif fault != "missing":
        middle = len(data) // 2
        flipped = data[:middle] + bytes([data[middle] ^ 255]) + data[middle + 1 :]
        path.write_bytes({"empty": b"", "cut": data[:-20], "flipped": flipped, "text": b"hello"}[fault])
    recording, items = read(asl.path)
    assert frames(items) == FRAMES[:2] + FRAMES[3:]
    assert [frame.seq for frame in of(Frame, items)] == [0, 1, 3, 4], "the gap shows the drop"
    assert recording.skipped == {f"image {reason}": 1}
    assert recording.warnings == [f"{path}: image {reason}, skipped"]
    assert capfd.readouterr() == ("", ""), "nobody else writes about it"


def test_images_of_another_size_are_skipped(asl: Any, read: Read) -> None:
    cv2.imwrite(str(asl.image_path(FRAMES[1])), np.zeros((24, 32), np.uint8))
    recording, items = read(asl.path)
    assert frames(items) == FRAMES[:1] + FRAMES[2:]
    assert recording.skipped == {"image of another size than the first": 1}


def test_the_first_good_image_sets_the_size(asl: Any, read: Read) -> None:
    asl.image_path(FRAMES[0]).write_bytes(b"")
    _, items = read(asl.path)
    assert frames(items) == FRAMES[1:]


def test_no_good_image_at_all_is_an_error(asl: Any, read: Read) -> None:
    for stamp in FRAMES:
        asl.image_path(stamp).write_bytes(b"")
    with pytest.raises(RecordingError, match=r"not one image could be read \(5 times: image empty\)"):
        read(asl.path)


def test_a_gap_of_seconds_is_passed_on(asl: Any, read: Read) -> None:
    late = 7_000_000_000
    asl.image_path(FRAMES[4]).rename(asl.image_path(late))
    asl.edit("cam0", 6, f"{late},{late}.png")
    recording, items = read(asl.path)
    assert frames(items) == [*FRAMES[:4], late]
    assert recording.warnings == []


def test_without_its_csv_a_folder_is_refused(asl: Any) -> None:
    asl.csv("cam0").unlink()
    with pytest.raises(RecordingError, match=r"cam0/data\.csv: missing; .*camera\.fps"):
        open_recording(asl.path, Config())
    asl.write("cam0", "#timestamp [ns],filename", [])
    with pytest.raises(RecordingError, match=r"cam0/data\.csv: names no images"):
        open_recording(asl.path, Config())


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    data=st.data(),
    content=st.one_of(st.binary(max_size=300), st.text("0123456789,.-#:[] \nT_BSdataeni").map(str.encode)),
)
def test_any_bytes_in_a_file_leave_a_recording_or_a_recording_error(
    asl: Any, data: st.DataObject, content: bytes
) -> None:
    files = ["cam0/data.csv", "imu0/data.csv", "odom0/data.csv", "cam0/sensor.yaml", "imu0/sensor.yaml"]
    file = asl.path / "mav0" / data.draw(st.sampled_from(files))
    good = file.read_bytes()
    at = data.draw(st.integers(0, len(good)))
    file.write_bytes(good[:at] + content + good[data.draw(st.integers(at, len(good))) :])
    said = ""
    try:
        list(open_recording(asl.path, Config()))
    except RecordingError as error:
        said = str(error)
    finally:
        file.write_bytes(good)
    assert "\n" not in said


def test_a_real_recording(data_folder: Path, read: Read) -> None:
    recording, items = read(data_folder / "kitti-straight")
    assert recording.lens == Lens(1226, 370, 707.0912, 707.0912, 601.8873, 183.1104)
    assert (len(of(Frame, items)), len(of(ImuSample, items)), len(of(SpeedSample, items))) == (51, 500, 51)
    assert {frame.image.shape for frame in of(Frame, items)} == {(370, 1226)}
    assert (recording.warnings, dict(recording.skipped)) == ([], {})
