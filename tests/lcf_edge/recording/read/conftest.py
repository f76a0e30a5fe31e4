"""Recordings to read: small ones, made on the spot; and the real ones, where they are at hand."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.recording.read import Recording, open_recording

Item = Frame | ImuSample | SpeedSample

CAMERA_YAML = """\
%YAML:1.0
# left camera
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, 0.1,
         1.0, 0.0, 0.0, 0.2,   # over several lines
         0.0, 0.0, 1.0, 0.3,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [64, 48]
camera_model: pinhole
intrinsics: [50.0, 51.0, 31.5, 23.5] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]
"""

IMU_YAML = """\
sensor_type: imu
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
"""


def texture(index: int, width: int = 64, height: int = 48) -> npt.NDArray[np.uint8]:
    """An image that encodes its index in its mean."""
    return np.full((height, width), 10 * index + 5, np.uint8)


@dataclass
class AslFolder:
    """A folder in the ASL layout: 5 images at 20/s, IMU at 100/s, odometry at 50/s."""

    path: Path

    def __post_init__(self) -> None:
        for sensor in ("cam0/data", "imu0", "odom0"):
            (self.path / "mav0" / sensor).mkdir(parents=True)
        frames = range(0, 250_000_000, 50_000_000)
        for index, stamp in enumerate(frames):
            cv2.imwrite(str(self.image_path(stamp)), texture(index))
        self.write("cam0", "#timestamp [ns],filename", (f"{t},{t}.png" for t in frames))
        samples = range(0, 260_000_000, 10_000_000)
        self.write("imu0", "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z", (f"{t},0.1,0.2,0.3,1,2,3" for t in samples))
        self.write("odom0", "#timestamp [ns],v_x [m s^-1],w_z [rad s^-1]", (f"{t},1.5,0.25" for t in samples[::2]))
        self.yaml("cam0", CAMERA_YAML)
        self.yaml("imu0", IMU_YAML)

    def csv(self, sensor: str) -> Path:
        return self.path / "mav0" / sensor / "data.csv"

    def image_path(self, stamp_ns: int) -> Path:
        return self.path / "mav0" / "cam0" / "data" / f"{stamp_ns}.png"

    def write(self, sensor: str, header: str, rows: Iterable[str]) -> None:
        self.csv(sensor).write_text("\n".join((header, *rows)) + "\n", encoding="utf-8")

    def yaml(self, sensor: str, text: str) -> Path:
        path = self.path / "mav0" / sensor / "sensor.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    def edit(self, sensor: str, line: int, text: str) -> None:
        """Replace a line of the csv, counted from 1."""
        lines = self.csv(sensor).read_text(encoding="utf-8").splitlines()
        lines[line - 1] = text
        self.write(sensor, lines[0], lines[1:])


@pytest.fixture
def asl(tmp_path: Path) -> AslFolder:
    return AslFolder(tmp_path / "drive")


@pytest.fixture
def read() -> Callable[..., tuple[Recording, list[Item]]]:
    """Open a recording and read it to its end."""

    def read_all(path: Path, **camera: Any) -> tuple[Recording, list[Item]]:
        recording = open_recording(path, config(**camera))
        return recording, list(recording)

    def config(**camera: Any) -> Config:
        default = Config()
        return Config(camera=type(default.camera)(**camera))

    return read_all


@pytest.fixture(scope="session")
def data_folder() -> Path:
    default = Path(__file__).parents[4].parent / "shared" / "data"
    folder = Path(os.environ.get("LCF_EDGE_DATA", default))
    if not folder.is_dir():
        pytest.skip("no real recordings here; set LCF_EDGE_DATA")
    return folder
