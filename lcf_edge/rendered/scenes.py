"""Rendered drives with exact truth: images, inertial samples, odometry; in memory or as EuRoC/ASL folder.

`make` draws a drive of a kind from a seed, `frames` renders it, `write` puts it into a folder that the
replay reads.
"""

from collections.abc import Iterator
from pathlib import Path

import cv2
import msgspec
import numpy as np

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.rendered.drives import Box, Drive, Floats, Lamp, Lens, Paint, Profile, SensorNoise, Shake, stamp_ns
from lcf_edge.rendered.layouts import KINDS, make
from lcf_edge.rendered.projection import Stage, View
from lcf_edge.rendered.rendering import Renderer
from lcf_edge.rendered.trajectory import Trajectory
from lcf_edge.rendered.truth import ObjectTruth, Truth, truth

__all__ = [
    "KINDS",
    "Box",
    "Drive",
    "Lamp",
    "Lens",
    "ObjectTruth",
    "Paint",
    "Profile",
    "SensorNoise",
    "Shake",
    "Truth",
    "frames",
    "imu",
    "make",
    "odometry",
    "truths",
    "write",
]

IMU_HZ = 200.0
ODOMETRY_HZ = 50.0

_MARGIN_S = 0.1  # the inertial samples begin before the first image and end after the last


def frames(drive: Drive) -> Iterator[tuple[Frame, Truth]]:
    """Images (height, width) uint8 with their truth, in order of time."""
    stage = Stage(drive)
    renderer = Renderer(stage)
    for seq, view in enumerate(_views(stage)):
        known = truth(stage, view, seq)
        yield Frame(known.stamp_ns, seq, renderer.image(view)), known


def truths(drive: Drive) -> Iterator[Truth]:
    """The truth alone, without drawing."""
    stage = Stage(drive)
    return (truth(stage, view, seq) for seq, view in enumerate(_views(stage)))


def _views(stage: Stage) -> Iterator[View]:
    drive = stage.drive
    return (stage.view(seq / drive.fps) for seq in range(round(drive.seconds * drive.fps)))


def imu(drive: Drive) -> list[ImuSample]:
    """Inertial samples at 200 Hz, camera axes, from 0.1 s before the first image to after the last."""
    times, trajectory, noise = _sensor_times(drive, IMU_HZ), Trajectory(drive), drive.noise
    random = np.random.default_rng([drive.seed, 1])
    gyro = trajectory.gyro(times) + noise.gyro_bias_radps
    accel = trajectory.specific_force(times) + noise.accel_bias_mps2
    gyro += random.normal(0, noise.gyro_radps, gyro.shape)
    accel += random.normal(0, noise.accel_mps2, accel.shape)
    return [
        ImuSample(stamp_ns(time), tuple(rate), tuple(force))
        for time, rate, force in zip(times.tolist(), gyro.tolist(), accel.tolist(), strict=True)
    ]


def odometry(drive: Drive) -> list[SpeedSample]:
    """Wheel odometry at 50 Hz over the same time as `imu`."""
    times, noise = _sensor_times(drive, ODOMETRY_HZ), drive.noise
    random = np.random.default_rng([drive.seed, 2])
    speed = drive.speed.at(times) * noise.speed_scale
    yaw_rate = drive.yaw_rate.at(times) * noise.speed_scale
    # Wheels at rest make no noise.
    speed += np.where(speed == 0, 0.0, random.normal(0, noise.speed_mps, speed.shape))
    yaw_rate += np.where(speed == 0, 0.0, random.normal(0, noise.yaw_rate_radps, speed.shape))
    return [
        SpeedSample(stamp_ns(time), v, w)
        for time, v, w in zip(times.tolist(), speed.tolist(), yaw_rate.tolist(), strict=True)
    ]


def write(drive: Drive, folder: Path) -> Path:
    """Write the drive as an EuRoC/ASL folder with `truth.jsonl` at its root. Return the folder.

    A truth line is one `Truth`; a time to contact or lateral miss that never comes is null. Raises OSError.
    """
    images = folder / "mav0" / "cam0" / "data"
    images.mkdir(parents=True, exist_ok=True)
    rows = []
    with (folder / "truth.jsonl").open("wb") as lines:
        for frame, known in frames(drive):
            name = f"{frame.stamp_ns}.png"
            _, data = cv2.imencode(".png", frame.image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
            (images / name).write_bytes(data.tobytes())
            rows.append(f"{frame.stamp_ns},{name}")
            lines.write(msgspec.json.encode(known) + b"\n")
    _write_sensor(folder, "cam0", "#timestamp [ns],filename", rows, _camera_yaml(drive))
    _write_sensor(
        folder,
        "imu0",
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
        "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
        [f"{s.stamp_ns}," + ",".join(f"{value:.6f}" for value in (*s.gyro, *s.accel)) for s in imu(drive)],
        _sensor_yaml("imu", "rendered, camera axes", IMU_HZ),
    )
    _write_sensor(
        folder,
        "odom0",
        "#timestamp [ns],v_x [m s^-1],w_z [rad s^-1]",
        [f"{s.stamp_ns},{s.speed_mps:.4f},{s.yaw_rate_radps:.5f}" for s in odometry(drive)],
    )
    return folder


def _write_sensor(folder: Path, sensor: str, header: str, rows: list[str], yaml: str = "") -> None:
    place = folder / "mav0" / sensor
    place.mkdir(parents=True, exist_ok=True)
    (place / "data.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    if yaml:
        (place / "sensor.yaml").write_text(yaml, encoding="utf-8")


def _sensor_yaml(sensor_type: str, comment: str, rate_hz: float) -> str:
    identity = ", ".join(str(value) for value in np.eye(4).ravel().tolist())
    return (
        f"sensor_type: {sensor_type}\ncomment: {comment}\n"
        f"T_BS:\n  cols: 4\n  rows: 4\n  data: [{identity}]\nrate_hz: {rate_hz:g}\n"
    )


def _camera_yaml(drive: Drive) -> str:
    lens, matrix = drive.lens, drive.lens.matrix
    model = "radial-tangential" if lens.model == "none" else lens.model
    distortion = ", ".join(str(value) for value in lens.distortion or (0.0,) * 4)
    fx, fy, cx, cy = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
    return (
        _sensor_yaml("camera", f"rendered drive, {drive.kind}, seed {drive.seed}", drive.fps)
        + f"resolution: [{lens.width}, {lens.height}]\ncamera_model: pinhole\n"
        f"intrinsics: [{fx}, {fy}, {cx}, {cy}] #fu, fv, cu, cv\n"
        f"distortion_model: {model}\ndistortion_coefficients: [{distortion}]\n"
    )


def _sensor_times(drive: Drive, rate_hz: float) -> Floats:
    count = round((drive.seconds + 2 * _MARGIN_S) * rate_hz)
    times: Floats = np.arange(count) / rate_hz - _MARGIN_S
    return times
