"""The lens against OpenCV's own models, and back."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Camera
from lcf_edge.errors import ConfigError
from lcf_edge.lens import Lens

PINHOLE = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
EUROC = Lens(
    752, 480, 458.654, 457.296, 367.215, 248.375,
    "radial-tangential", (-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05),
)  # fmt: skip
WIDE = Lens(
    1392, 512, 984.2439, 980.8141, 690.0, 233.1966,
    "radial-tangential", (-0.3728755, 0.2037299, 0.002219027, 0.001383707, -0.07233722),
)  # fmt: skip
FISHEYE = Lens(640, 480, 290.0, 291.0, 321.0, 238.0, "equidistant", (-0.0034, 0.0007, -0.002, 0.0002))
BENT = [EUROC, WIDE, FISHEYE]


def grid(lens: Lens, step: int = 16) -> Any:
    """Whole pixels over the frame, its last row and column included."""
    x, y = np.meshgrid(
        np.append(np.arange(0, lens.width, step), lens.width - 1),
        np.append(np.arange(0, lens.height, step), lens.height - 1),
    )
    return np.stack((x.ravel(), y.ravel()), axis=1)


def opencv_distort(lens: Lens, ideal: Any) -> Any:
    rays = np.column_stack(((ideal - [lens.cx, lens.cy]) / [lens.fx, lens.fy], np.ones(len(ideal))))
    project = cv2.fisheye.projectPoints if lens.model == "equidistant" else cv2.projectPoints
    zero, coefficients = np.zeros(3), np.array(lens.coefficients)
    return project(rays.reshape(-1, 1, 3), zero, zero, lens.matrix, coefficients)[0].reshape(-1, 2)


@pytest.mark.parametrize("lens", BENT, ids=["euroc", "wide", "fisheye"])
class TestBentLens:
    def test_distort_is_the_model_of_opencv(self, lens: Lens) -> None:
        spread = (grid(lens) - [lens.cx, lens.cy]) * 0.95 + [lens.cx, lens.cy]
        np.testing.assert_allclose(lens.distort(spread.astype(np.float32)), opencv_distort(lens, spread), atol=1e-3)

    def test_undistort_is_its_inverse_over_the_whole_frame(self, lens: Lens) -> None:
        points = (grid(lens) + 0.3).astype(np.float32)
        ideal = lens.undistort(points)
        assert ideal.dtype == np.float32
        assert np.isfinite(ideal).all()
        np.testing.assert_allclose(opencv_distort(lens, ideal.astype(np.float64)), points, atol=2e-3)

    def test_table_of_whole_pixels_is_undistort(self, lens: Lens) -> None:
        pixels = grid(lens)
        by_table = lens.undistort_pixels(*pixels.T.astype(np.int16))
        np.testing.assert_array_equal(by_table, lens.undistort(pixels.astype(np.float32)))

    def test_table_takes_8_bytes_a_pixel(self, lens: Lens) -> None:
        assert lens._table.nbytes == 8 * lens.width * lens.height

    @given(x=st.floats(-0.2, 1.2), y=st.floats(-0.2, 1.2))
    def test_round_trip_or_nan(self, lens: Lens, x: float, y: float) -> None:
        point = np.array([[x * lens.width, y * lens.height]], np.float32)
        back = lens.distort(lens.undistort(point))
        assert np.isnan(back).all() or np.abs(back - point).max() < 5e-3

    def test_no_points_are_no_points(self, lens: Lens) -> None:
        none = np.empty((0, 2), np.float32)
        assert lens.distort(none).shape == lens.undistort(none).shape == (0, 2)

    def test_nan_stays_nan(self, lens: Lens) -> None:
        lost = np.full((1, 2), np.nan, np.float32)
        assert np.isnan(lens.distort(lost)).all()
        assert np.isnan(lens.undistort(lost)).all()


@pytest.mark.parametrize("lens", [PINHOLE, replace(PINHOLE, model="radial-tangential", coefficients=(0.0,) * 4)])
def test_lens_that_does_not_bend_changes_nothing(lens: Lens) -> None:
    points = np.array([[1.5, 2.5]], np.float32)
    assert lens.distort(points) is points
    assert lens.undistort(points) is points
    whole = lens.undistort_pixels(np.array([3]), np.array([7]))
    np.testing.assert_array_equal(whole, np.array([[3, 7]], np.float32))
    assert whole.dtype == np.float32


def test_beyond_85_degrees_of_a_fisheye_is_nan() -> None:
    lens = Lens(1200, 100, 360.0, 360.0, 600.0, 50.0, "equidistant", (0.0, 0.0, 0.0, 0.0))
    radius = 360.0 * np.radians([84.9, 85.1])
    ideal = lens.undistort(np.column_stack((600.0 + radius, [50.0, 50.0])).astype(np.float32))
    assert ideal[0, 0] == pytest.approx(600.0 + 360.0 * np.tan(np.radians(84.9)), rel=1e-4)
    assert np.isnan(ideal[1]).all()
    too_far = np.array([[600.0 + 360.0 * np.tan(np.radians(85.1)), 50.0]], np.float32)
    assert np.isnan(lens.distort(too_far)).all()


@pytest.mark.parametrize("decentring", [(0.0, 0.0), (1e-3, -1e-3)])
def test_past_the_fold_is_nan_both_ways(decentring: tuple[float, float]) -> None:
    """r - r³/2 grows up to r = 0.816, where it is 0.544, and then folds back."""
    lens = Lens(800, 400, 400.0, 400.0, 400.0, 200.0, "radial-tangential", (-0.5, 0.0, *decentring))
    past = np.array([[400.0 + 400.0 * 0.56, 200.0], [0.0, 0.0]], np.float32)
    assert np.isnan(lens.undistort(past)).all()
    folded = np.array([[400.0 + 400.0 * 0.9, 200.0]], np.float32)  # would come out inside the frame
    assert np.isnan(lens.distort(folded)).all()
    table = lens.undistort_pixels(np.array([0, 400]), np.array([0, 200]))
    assert np.isnan(table).all(axis=1).tolist() == [True, False]


class TestBearing:
    def test_right_and_up_are_positive(self) -> None:
        bearing, elevation = PINHOLE.bearing(PINHOLE.cx + PINHOLE.fx, PINHOLE.cy)
        assert (bearing, elevation) == pytest.approx((np.pi / 4, 0.0))
        bearing, elevation = PINHOLE.bearing(PINHOLE.cx, PINHOLE.cy - PINHOLE.fy)
        assert (bearing, elevation) == pytest.approx((0.0, np.pi / 4))

    @given(st.floats(-1.3, 1.3), st.floats(-1.3, 1.3))
    def test_is_the_ray_that_the_pixel_sees(self, bearing: float, elevation: float) -> None:
        right, up = np.cos(elevation) * np.sin(bearing), np.sin(elevation)
        forward = np.cos(elevation) * np.cos(bearing)
        x, y = PINHOLE.cx + PINHOLE.fx * right / forward, PINHOLE.cy - PINHOLE.fy * up / forward
        assert PINHOLE.bearing(x, y) == pytest.approx((bearing, elevation), abs=1e-9)

    def test_takes_arrays(self) -> None:
        bearing, elevation = PINHOLE.bearing(np.zeros(3), np.zeros(3))
        assert bearing.shape == elevation.shape == (3,)


class TestFromConfig:
    def test_intrinsics_are_taken_as_they_are(self) -> None:
        camera = Camera(
            width=EUROC.width, height=EUROC.height, intrinsics=list(EUROC.matrix[[0, 1, 0, 1], [0, 1, 2, 2]]),
            distortion_model=EUROC.model, distortion=list(EUROC.coefficients),
        )  # fmt: skip
        assert Lens.from_config(camera, EUROC.width, EUROC.height) == EUROC

    @pytest.mark.parametrize(
        ("model", "coefficients"),
        [
            ("none", []),
            ("radial-tangential", [-0.28, 0.07, 0.0, 0.0]),
            ("equidistant", [0.01, -0.02, 0.003, 0.0]),
        ],
    )
    def test_field_of_view_spans_the_image(self, model: Any, coefficients: list[float]) -> None:
        camera = Camera(horizontal_fov_rad=1.2, distortion_model=model, distortion=coefficients)
        lens = Lens.from_config(camera, 800, 600)
        assert (lens.cx, lens.cy, lens.fx) == (399.5, 299.5, lens.fy)
        edges = lens.undistort(np.array([[-0.5, 299.5], [799.5, 299.5]], np.float32))
        bearing, _ = lens.bearing(*edges.T)
        np.testing.assert_allclose(bearing, [-0.6, 0.6], atol=1e-5)

    def test_field_of_view_beyond_the_model_is_refused(self) -> None:
        camera = Camera(horizontal_fov_rad=2.5, distortion_model="radial-tangential", distortion=[-0.5, 0.0, 0.0, 0.0])
        with pytest.raises(ConfigError, match="horizontal_fov_rad"):
            Lens.from_config(camera, 640, 480)

    @given(st.integers(1, 4))
    def test_smaller_image_sees_the_same_rays(self, factor: int) -> None:
        lens = WIDE.scaled(WIDE.width // factor, WIDE.height // factor)
        corner = np.array([[-0.5, -0.5]], np.float32)
        np.testing.assert_allclose(
            lens.bearing(*lens.undistort(corner)[0]), WIDE.bearing(*WIDE.undistort(corner)[0]), atol=1e-3
        )

    def test_size_rounded_to_whole_pixels_is_the_same_aspect(self) -> None:
        kitti = Lens(1241, 376, 718.856, 718.856, 607.19, 185.22)
        assert kitti.scaled(620, 188).fx == pytest.approx(718.856 / 2, rel=1e-3)

    def test_another_aspect_is_refused_in_one_line(self) -> None:
        with pytest.raises(ConfigError, match=r"752x480.*640x480.*camera\.intrinsics") as refusal:
            EUROC.scaled(640, 480)
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"coefficients": (0.1,)}, "coefficients"),
        ({"model": "equidistant", "coefficients": (0.0,) * 5}, "coefficients"),
        ({"fx": 0.0}, "positive"),
        ({"cx": float("nan")}, "finite"),
    ],
)
def test_impossible_lens_is_refused(change: dict[str, Any], message: str) -> None:
    known = {"width": 640, "height": 480, "fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0}
    with pytest.raises(ConfigError, match=message):
        Lens(**(known | change))
