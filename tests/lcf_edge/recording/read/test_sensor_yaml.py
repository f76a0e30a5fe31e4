"""sensor.yaml: its dialects, and what is said about one that cannot be used."""

from pathlib import Path

import numpy as np
import pytest

from lcf_edge.errors import RecordingError
from lcf_edge.lens import Lens
from lcf_edge.recording.read.sensor_yaml import SensorYaml

GOOD = """\
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375]
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
"""


def sensor(tmp_path: Path, text: str) -> SensorYaml:
    path = tmp_path / "sensor.yaml"
    path.write_text(text, encoding="utf-8")
    return SensorYaml(path)


def test_lens(tmp_path: Path) -> None:
    assert sensor(tmp_path, GOOD).lens() == Lens(
        752, 480, 458.654, 457.296, 367.215, 248.375, "radial-tangential",
        (-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "model"),
    [("radtan", "radial-tangential"), ("plumb_bob", "radial-tangential"), ("Equidistant", "equidistant"),
     ("fisheye", "equidistant"), ("'equidistant'", "equidistant")],
)  # fmt: skip
def test_names_of_distortion_models(tmp_path: Path, name: str, model: str) -> None:
    assert sensor(tmp_path, GOOD.replace("radial-tangential", name)).lens().model == model


@pytest.mark.parametrize("coefficients", ["[0.0, 0.0, 0.0, 0.0]", "[]"])
def test_no_coefficients_are_no_distortion(tmp_path: Path, coefficients: str) -> None:
    lens = sensor(tmp_path, GOOD.rsplit(":", 1)[0] + f": {coefficients}").lens()
    assert (lens.model, lens.coefficients) == ("none", ())


def test_a_camera_without_distortion_keys(tmp_path: Path) -> None:
    assert sensor(tmp_path, "".join(GOOD.splitlines(True)[:3])).lens().model == "none"


QUARTER_TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    "text",
    [
        "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 5, 1, 0, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1]\n",
        "%YAML:1.0\n---\nT_BS: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n"
        "   data: [ 0., -1., 0., 5.,\n     1., 0., 0., 6., # second row\n"
        "     0., 0., 1., 7., 0., 0., 0., 1. ]\n",
        "T_BS: [[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]]\n",
        "T_BS:\n- - 0.0\n  - -1.0\n  - 0.0\n  - 5.0\n- [1.0, 0.0, 0.0, 6.0]\n- [0.0, 0.0, 1.0, 7.0]\n- [0, 0, 0, 1]\n",
    ],
    ids=["euroc", "opencv", "rows", "items"],
)
def test_forms_of_a_matrix(tmp_path: Path, text: str) -> None:
    np.testing.assert_array_equal(sensor(tmp_path, text).rotation(), QUARTER_TURN)


def test_no_mounting_is_the_identity(tmp_path: Path) -> None:
    np.testing.assert_array_equal(sensor(tmp_path, GOOD).rotation(), np.eye(3))


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("458.654", "f", "intrinsics"),
        ("458.654, ", "", "intrinsics"),
        ("458.654", "nan", "intrinsics"),
        ("458.654", "-458", "focal"),
        ("intrinsics", "intrinsic", "intrinsics"),
        ("752", "0", "resolution"),
        ("752", "752.5", "resolution"),
        ("[752, 480]", "", "resolution"),
        ("pinhole", "omni", "camera_model"),
        ("radial-tangential", "spline", "distortion_model"),
        ("distortion_coefficients", "coefficients", "distortion_coefficients"),
        ("-0.28340811, 0.07395907, ", "", "distortion_model"),
        ("camera_model: pinhole", "camera_model pinhole", ":2"),
    ],
)
def test_what_cannot_be_used_is_named(tmp_path: Path, old: str, new: str, key: str) -> None:
    with pytest.raises(RecordingError) as caught:
        sensor(tmp_path, GOOD.replace(old, new)).lens()
    message = str(caught.value)
    assert "sensor.yaml" in message
    assert key in message
    assert "fix" in message
    assert "\n" not in message


@pytest.mark.parametrize("first", ["2", "-1"])
def test_a_mounting_that_is_no_rotation_is_refused(tmp_path: Path, first: str) -> None:
    with pytest.raises(RecordingError, match=r"sensor\.yaml: T_BS.*not a rotation"):
        sensor(tmp_path, f"T_BS: [{first}, 0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]").rotation()


@pytest.mark.parametrize("content", [b"\xff\xfe\x00garbage", b"#" * 100_000])
def test_a_file_that_is_no_text_or_too_large_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "sensor.yaml"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"sensor\.yaml: .*fix or remove"):
        SensorYaml(path)
