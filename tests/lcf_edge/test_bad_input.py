"""Bad input through the real command: a clear error or a counted skip, and nothing lost of what was good."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

from drivers.samples import Frame, ImuSample

Grey = npt.NDArray[np.uint8]
Lines = list[dict[str, Any]]

FRAMES = 10
PATIENCE_S = 60.0
SENSOR_YAML = "resolution: [320, 240]\nintrinsics: [250.0, 250.0, 159.5, 119.5]\n"
IMU_YAML = "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"


@dataclass(frozen=True)
class Replayed:
    """What a user sees of a replay."""

    status: int
    summary: dict[str, str]
    warnings: list[str]
    error: str  # empty: none
    lines: Lines | None  # of -o, None: the file was not made

    @property
    def skipped(self) -> dict[str, int]:
        """Counts of the summary."""
        parts = re.findall(r"(?:^|, )(.+?): (\d+)", self.summary.get("skipped", ""))
        return {reason: int(count) for reason, count in parts}

    @property
    def sequence(self) -> list[int]:
        assert self.lines is not None
        return [line["seq"] for line in self.lines]

    def warned_of(self, *parts: str) -> bool:
        """Whether one warning has all the parts."""
        return any(all(part in warning for part in parts) for warning in self.warnings)


@pytest.fixture
def replay(tmp_path: Path) -> Callable[..., Replayed]:
    """``lcf-edge replay`` in a process of its own; sees to it that nothing but plain lines comes out."""

    def run(recording: Path, *arguments: object) -> Replayed:
        results = tmp_path / "results.jsonl"
        command = [sys.executable, "-m", "lcf_edge", "replay", str(recording), "-o", str(results)]
        done = subprocess.run(
            [*command, *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
            env={**os.environ, "PYTHONWARNINGS": "default"},
        )
        errors = done.stderr.splitlines()
        assert "Traceback" not in done.stdout + done.stderr
        assert all(line.startswith("lcf-edge: ") for line in errors), done.stderr
        warned_of = [line for line in errors if not line.startswith("lcf-edge: warning: ")]
        assert len(warned_of) == (done.returncode != 0), done.stderr
        assert bool(done.stdout) == (done.returncode == 0)
        lines = [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else None
        summary = dict(line.split(maxsplit=1) for line in done.stdout.splitlines())
        if done.returncode == 0:
            assert lines is not None
            assert summary["frames"].startswith(f"{len(lines)},")
        return Replayed(done.returncode, summary, [e for e in errors if e not in warned_of], "".join(warned_of), lines)

    return run


@dataclass
class Drive:
    """A recording in the ASL layout, to be damaged: each csv as rows, line 1 is its header."""

    root: Path
    rows: dict[str, list[str]] = field(default_factory=dict)

    def image_path(self, seq: int) -> Path:
        return self.root / "mav0/cam0/data" / self.rows["cam0"][1 + seq].split(",")[1]

    def csv(self, sensor: str) -> Path:
        return self.root / "mav0" / sensor / "data.csv"

    def change(self, sensor: str, number: int, row: str) -> None:
        """Replace a row, the first is 0, and write the csv."""
        self.rows[sensor][1 + number] = row
        self.write(sensor)

    def write(self, sensor: str) -> None:
        self.csv(sensor).parent.mkdir(parents=True, exist_ok=True)
        self.csv(sensor).write_text("\n".join(self.rows[sensor]) + "\n")


@pytest.fixture(scope="module")
def items(approach: Callable[..., Any]) -> list[Any]:
    return list(approach(frames=FRAMES))


@pytest.fixture(scope="module")
def good_drive(items: list[Any], tmp_path_factory: pytest.TempPathFactory) -> Drive:
    drive = Drive(tmp_path_factory.mktemp("good"))
    images_folder = drive.root / "mav0/cam0/data"
    images_folder.mkdir(parents=True)
    rows = drive.rows
    rows["cam0"] = ["#timestamp [ns],filename"]
    rows["imu0"] = ["#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z"]
    rows["odom0"] = ["#timestamp [ns],v_x [m s^-1],w_z [rad s^-1]"]
    for item in items:
        if isinstance(item, Frame):
            cv2.imwrite(str(images_folder / f"{item.stamp_ns}.png"), item.image)
            rows["cam0"].append(f"{item.stamp_ns},{item.stamp_ns}.png")
        elif isinstance(item, ImuSample):
            rows["imu0"].append(",".join(map(str, (item.stamp_ns, *item.gyro, *item.accel))))
        else:
            rows["odom0"].append(f"{item.stamp_ns},{item.speed_mps},{item.yaw_rate_radps}")
    for sensor in rows:
        drive.write(sensor)
    (drive.root / "mav0/cam0/sensor.yaml").write_text(SENSOR_YAML)
    (drive.root / "mav0/imu0/sensor.yaml").write_text(IMU_YAML)
    return drive


@pytest.fixture
def drive(good_drive: Drive, tmp_path: Path) -> Drive:
    root = tmp_path / "drive"
    shutil.copytree(good_drive.root, root)
    return Drive(root, {sensor: [*rows] for sensor, rows in good_drive.rows.items()})


def without(*seqs: int) -> list[int]:
    return [seq for seq in range(FRAMES) if seq not in seqs]


def test_a_good_recording_has_nothing_to_report(replay: Callable[..., Replayed], drive: Drive) -> None:
    done = replay(drive.root)
    assert (done.status, done.warnings, done.skipped) == (0, [], {})
    assert done.sequence == without()


# Nothing to replay


def test_an_empty_folder(replay: Callable[..., Replayed], tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    done = replay(tmp_path / "empty")
    assert (done.status, done.warnings, done.lines) == (1, [], None)
    assert f"{tmp_path / 'empty'}: empty folder; wanted are images" in done.error


def test_no_image_that_can_be_read(replay: Callable[..., Replayed], drive: Drive) -> None:
    for seq in range(FRAMES):
        drive.image_path(seq).write_bytes(b"")
    done = replay(drive.root)
    assert (done.status, done.lines) == (1, [])
    assert f"{drive.root}: not one image could be read ({FRAMES} times: image empty)" in done.error
    assert "record it again" in done.error


@pytest.mark.parametrize(
    ("setting", "warned_of"),
    [
        ("vehicle.half_widht_m=0.6", "unknown key vehicle.half_widht_m; did you mean vehicle.half_width_m?"),
        ("camera.intrinsics=[500, 500, 300, 300]", "camera.intrinsics: made for 640x480, the images are "),
    ],
)
def test_a_configuration_that_does_not_fit(
    replay: Callable[..., Replayed], drive: Drive, setting: str, warned_of: str
) -> None:
    size = ("--set", "camera.height=500") if "intrinsics" in setting else ()
    done = replay(drive.root, "--set", setting, *size)
    assert done.status == 2
    assert warned_of.replace("640x480", "640x500") in done.error
    assert not done.lines


# Images


def test_a_truncated_png(replay: Callable[..., Replayed], drive: Drive) -> None:
    victim = drive.image_path(4)
    victim.write_bytes(victim.read_bytes()[:2000])
    done = replay(drive.root)
    assert (done.status, done.sequence) == (0, without(4))
    assert done.warned_of(str(victim), "image damaged, skipped")
    assert done.skipped == {"image damaged": 1}


def test_images_that_change_size(replay: Callable[..., Replayed], drive: Drive) -> None:
    for seq in (3, 7):
        image = cv2.imread(str(drive.image_path(seq)), cv2.IMREAD_GRAYSCALE)
        assert image is not None
        cv2.imwrite(str(drive.image_path(seq)), cv2.resize(image, (160, 120)))
    done = replay(drive.root)
    assert (done.status, done.sequence) == (0, without(3, 7))
    assert done.warned_of(str(drive.image_path(3)), "another size")
    assert done.skipped == {"image of another size than the first": 2}


def test_an_image_without_a_corner(replay: Callable[..., Replayed], drive: Drive) -> None:
    cv2.imwrite(str(drive.image_path(5)), np.full((240, 320), 128, np.uint8))
    done = replay(drive.root)
    assert (done.status, done.warnings, done.sequence) == (0, [], without())
    assert "no corners: 1" in done.summary["notes"]
    assert done.lines is not None
    assert done.lines[5]["sizes"]["corners"] == 0


def test_20_000_corners(replay: Callable[..., Replayed], noise: Callable[..., Grey], tmp_path: Path) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for seq in range(3):
        cv2.imwrite(str(folder / f"{seq}.png"), noise(seq))
    fixed = ("--set", "filter.fast_adaptive=false", "--set", "filter.fast_threshold=8")
    done = replay(folder, *fixed, "--set", "camera.intrinsics=[500, 500, 319.5, 239.5]")
    assert (done.status, done.warnings, done.sequence) == (0, [], [0, 1, 2])
    assert done.lines is not None
    assert {line["sizes"]["corners"] for line in done.lines} == {1500}
    evicted = sum(line["sizes"]["evicted"] for line in done.lines)
    assert evicted > 3 * 18_500
    assert f"{evicted} rows" in done.summary["evicted"]


# Rows


def test_bad_rows_of_the_camera(replay: Callable[..., Replayed], drive: Drive) -> None:
    stamp = drive.rows["cam0"][1 + 7].partition(",")[0]
    rows = ("garbage", "", "-5,a.png", "9" * 30 + ",a.png", f"{stamp},../cam0/secret.png", f"{stamp},missing.png")
    for number, row in enumerate(rows, 2):
        drive.change("cam0", number, row)
    done = replay(drive.root)
    assert done.status == 0
    assert len(done.sequence) == FRAMES - len(rows)
    assert done.skipped == {"image row malformed": 4, "image missing": 1}
    for line in (4, 6, 7, 8):
        assert done.warned_of(f"{drive.csv('cam0')}:{line}: image row malformed, skipped")
    assert done.warned_of("missing.png: image missing, skipped")


def test_bad_samples_of_the_imu(replay: Callable[..., Replayed], drive: Drive) -> None:
    bad = {
        "imu row malformed": ("garbage", "{},0,0,0", "{},0,0,0,0,-9.81,down"),
        "imu row with NaN or inf": ("{},nan,0,0,0,-9.81,0", "{},0,0,0,0,-inf,0"),
        "imu out of range": ("{},1e4,0,0,0,-9.81,0", "{},0,0,0,1e300,0,0"),
    }
    for number, row in enumerate((row for rows in bad.values() for row in rows), 9):
        drive.change("imu0", number, row.format(drive.rows["imu0"][1 + number].partition(",")[0]))
    done = replay(drive.root)
    assert (done.status, done.sequence) == (0, without())
    assert done.skipped == {reason: len(rows) for reason, rows in bad.items()}
    assert done.warned_of(f"{drive.csv('imu0')}:11: imu row malformed, skipped")
    assert done.warned_of(f"{drive.csv('imu0')}:14: imu row with NaN or inf, skipped")


def test_an_imu_of_nothing_but_nan(replay: Callable[..., Replayed], drive: Drive) -> None:
    rows = drive.rows["imu0"]
    rows[1:] = [",".join([row.partition(",")[0], *["nan"] * 6]) for row in rows[1:]]
    drive.write("imu0")
    done = replay(drive.root)
    assert (done.status, done.sequence) == (0, without())
    assert done.skipped == {"imu row with NaN or inf": len(rows) - 1}
    assert len(done.warnings) < 10  # the rest is only counted
    assert f"no imu: {FRAMES}" in done.summary["notes"]


def test_times_that_go_back(replay: Callable[..., Replayed], drive: Drive) -> None:
    for sensor, number in (("cam0", 6), ("imu0", 20), ("odom0", 20)):
        early, _, rest = drive.rows[sensor][1 + number].partition(",")
        drive.change(sensor, number, f"{int(early) - 300_000_000},{rest}")
    done = replay(drive.root)
    assert (done.status, done.sequence) == (0, [*range(FRAMES - 1)])
    assert done.lines is not None
    stamps = [line["stamp_ns"] for line in done.lines]
    assert stamps == sorted(set(stamps))
    assert done.skipped == {f"{kind} time that does not increase": 1 for kind in ("image", "imu", "speed")}
    assert done.warned_of(f"{drive.csv('cam0')}:8: ")


def test_a_gap_of_seconds(replay: Callable[..., Replayed], drive: Drive) -> None:
    for sensor, rows in drive.rows.items():
        first_ns = int(rows[1].partition(",")[0])
        for number, row in enumerate(rows[1:]):
            stamp, _, rest = row.partition(",")
            late_ns = 7_000_000_000 if int(stamp) - first_ns > 220_000_000 else 0
            drive.rows[sensor][1 + number] = f"{int(stamp) + late_ns},{rest}"
        drive.write(sensor)
    done = replay(drive.root)
    assert (done.status, done.warnings, done.skipped, done.sequence) == (0, [], {}, without())
    assert "7.4 s of recording" in done.summary["frames"] or "7.5 s of recording" in done.summary["frames"]
    assert "imu gap: 1" in done.summary["notes"]


# Calibration


def test_missing_intrinsics(replay: Callable[..., Replayed], drive: Drive) -> None:
    (drive.root / "mav0/cam0/sensor.yaml").unlink()
    done = replay(drive.root)
    assert (done.status, done.sequence) == (0, without())
    assert done.warned_of(str(drive.root), "no intrinsics", "set camera.intrinsics")


def test_broken_intrinsics(replay: Callable[..., Replayed], drive: Drive) -> None:
    sensor_yaml = drive.root / "mav0/cam0/sensor.yaml"
    sensor_yaml.write_text(SENSOR_YAML.replace("250.0, 159.5", "nan, 159.5"))
    done = replay(drive.root)
    assert (done.status, done.lines) == (1, None)
    assert f"{sensor_yaml}: intrinsics: 4 numbers are needed; fix or remove the file" in done.error


# MCAP


def mcap_file(path: Path, items: list[Any]) -> list[int]:
    """Images as ``ros2 bag record`` writes them. Return the size of the file after each."""
    ros = get_typestore(Stores.ROS2_HUMBLE)
    kind = "sensor_msgs/msg/Image"
    sizes = []
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1)  # a chunk for each message
        writer.start(profile="ros2")
        schema = writer.register_schema(kind, "ros2msg", b"")
        channel = writer.register_channel("/camera/image_raw", "cdr", schema)
        for frame in (item for item in items if isinstance(item, Frame)):
            seconds, nanoseconds = divmod(frame.stamp_ns, 10**9)
            stamp = ros.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
            height, width = frame.image.shape
            message = ros.types[kind](
                header=ros.types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera"),
                height=height,
                width=width,
                encoding="mono8",
                is_bigendian=0,
                step=width,
                data=frame.image.ravel(),
            )
            data = bytes(ros.serialize_cdr(message, kind))
            writer.add_message(channel, frame.stamp_ns, data, frame.stamp_ns)
            file.flush()
            sizes.append(file.tell())
        writer.finish()
    return sizes


def test_a_truncated_mcap(replay: Callable[..., Replayed], items: list[Any], tmp_path: Path) -> None:
    bag = tmp_path / "drive.mcap"
    sizes = mcap_file(bag, items)
    bag.write_bytes(bag.read_bytes()[: (sizes[5] + sizes[6]) // 2])
    cut = replay(bag)
    assert cut.status == 0
    assert cut.sequence[:6] == [0, 1, 2, 3, 4, 5]
    assert cut.warned_of(str(bag), "damaged at byte", "read up to there")
    bag.write_bytes(bag.read_bytes()[:20])
    nothing = replay(bag)
    assert (nothing.status, nothing.lines) == (1, cut.lines)  # what stood there is left alone
    assert f"{bag}: " in nothing.error


# All at once


def test_all_of_it_in_one_recording(replay: Callable[..., Replayed], drive: Drive, tmp_path: Path) -> None:
    (drive.root / "mav0/cam0/sensor.yaml").unlink()
    drive.image_path(1).write_bytes(drive.image_path(1).read_bytes()[:-500])
    cv2.imwrite(str(drive.image_path(3)), np.zeros((10, 10), np.uint8))
    cv2.imwrite(str(drive.image_path(5)), np.zeros((240, 320), np.uint8))
    drive.image_path(8).unlink()
    drive.change("imu0", 5, "garbage")
    drive.change("odom0", 5, "1,nan,0")
    video = tmp_path / "overlay.webm"
    done = replay(drive.root, "--video", video)
    assert (done.status, done.sequence) == (0, without(1, 3, 8))
    assert sum(done.skipped.values()) == 5
    assert len(done.warnings) == 6
    assert video.stat().st_size > 0
