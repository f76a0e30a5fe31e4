"""Ego-motion against motions that are known exactly."""

from collections.abc import Callable, Iterable, Iterator
from math import inf, isnan, nan

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.samples import ImuSample, SpeedSample
from lcf_edge.config import Imu, Vehicle
from lcf_edge.ego_motion.axis_bias import PRIOR_RADPS
from lcf_edge.ego_motion.estimator import IMU_CAPACITY, EgoMotion, EgoMotionEstimator
from lcf_edge.ego_motion.gyro_bias import GyroBias
from lcf_edge.filter.ground_speed import GroundSpeed

G = 9.81
LEVEL = (0.0, -G, 0.0)
T0 = 1_700_000_000_000_000_000
SECOND = 1_000_000_000


def ns(t_s: float) -> int:
    return T0 + round(t_s * 1e9)


def estimator(imu: Imu | None = None, **vehicle: object) -> EgoMotionEstimator:
    return EgoMotionEstimator(imu or Imu(), Vehicle(**vehicle))  # type: ignore[arg-type]


def calibrated(imu: Imu | None = None) -> EgoMotionEstimator:
    """Whose bias is known: 0."""
    ego = estimator(imu)
    ego.bias.see_rest(np.zeros(3), 1e-6)
    return ego


def feed(
    ego: EgoMotionEstimator,
    times_s: Iterable[float],
    gyro: Callable[[float], tuple[float, float, float]] = lambda _: (0.0, 0.0, 0.0),
    accel: Callable[[float], tuple[float, float, float]] = lambda _: LEVEL,
) -> None:
    for t in times_s:
        ego.add_imu(ImuSample(ns(t), gyro(t), accel(t)))


def turned_by(vector_rad: Iterable[float]) -> np.ndarray:
    """Rotation of directions in the camera's axes when the camera turns by the vector, by OpenCV."""
    rotation: np.ndarray = cv2.Rodrigues(-np.array(list(vector_rad), float))[0]
    return rotation


RATE = (0.2, -0.7, 0.4)


class TestRotation:
    @given(
        start=st.floats(0.05, 0.1),
        length=st.floats(0.001, 0.2),
        rate_hz=st.sampled_from([50.0, 100.0, 187.0, 400.0]),
    )
    @settings(max_examples=40, deadline=None)
    def test_constant_rate_over_an_unaligned_interval_is_exact(
        self, start: float, length: float, rate_hz: float
    ) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 0.4, 1 / rate_hz), gyro=lambda _: RATE)
        ego.advance(ns(start))
        motion = ego.advance(ns(start + length))
        assert motion.dt_s == pytest.approx((ns(start + length) - ns(start)) / 1e9)
        np.testing.assert_allclose(motion.rotation, turned_by(np.array(RATE) * motion.dt_s), atol=1e-9)
        assert motion.yaw_rate_radps == pytest.approx(0.7)

    def test_many_frames_compose_to_the_whole_turn(self) -> None:
        ego = estimator()
        whole = np.eye(3)
        ego.advance(ns(0.0131))
        sample = 0
        for t in 0.0131 + np.arange(1, 201) * 0.0317:
            while sample * 0.005 <= t + 0.005:
                feed(ego, [sample * 0.005], gyro=lambda _: RATE)
                sample += 1
            whole = ego.advance(ns(t)).rotation @ whole
        np.testing.assert_allclose(whole, turned_by(np.array(RATE) * 200 * 0.0317), atol=1e-7)  # stamps: whole ns

    def test_varying_rate_about_one_axis_is_its_integral(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 2, 0.01), gyro=lambda t: (0.0, np.sin(8 * t), 0.0))
        ego.advance(ns(0.1037))
        motion = ego.advance(ns(0.2512))
        angle = (np.cos(8 * 0.1037) - np.cos(8 * 0.2512)) / 8
        assert cv2.Rodrigues(motion.rotation)[0].ravel() == pytest.approx([0.0, -angle, 0.0], rel=0.01)

    def test_turning_left_is_positive_and_moves_the_image_right(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 0.2, 0.01), gyro=lambda _: (0.0, -0.5, 0.0))
        ego.advance(ns(0.0))
        motion = ego.advance(ns(0.1))
        ahead = motion.rotation @ [0.0, 0.0, 1.0]
        assert motion.yaw_rate_radps == pytest.approx(0.5)
        assert ahead == pytest.approx([np.sin(0.05), 0.0, np.cos(0.05)])

    def test_axes_turn_the_samples_into_the_camera(self) -> None:
        axes = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]  # of a body: x forward, y left, z up
        ego = estimator(Imu(axes=axes), speed_source="imu")
        feed(ego, np.arange(0, 0.9, 0.01), accel=lambda _: (0.0, 0.0, G))
        ego.advance(ns(0.2))
        assert ego.advance(ns(0.8)).speed_mps == 0
        feed(ego, np.arange(0.9, 1.2, 0.01), gyro=lambda _: (0.0, 0.0, 0.5), accel=lambda _: (2.0, 0.0, G))
        ego.advance(ns(0.95))
        motion = ego.advance(ns(1.05))
        assert motion.yaw_rate_radps == pytest.approx(0.5)
        assert motion.speed_mps == pytest.approx(2.0 * 0.1, abs=0.01)

    def test_time_offset_moves_the_samples(self) -> None:
        ego = estimator(Imu(time_offset_s=0.25))
        feed(ego, np.arange(0, 1, 0.01), gyro=lambda t: (0.0, 0.0, t))
        ego.advance(ns(0.5))
        motion = ego.advance(ns(0.6))
        assert cv2.Rodrigues(motion.rotation)[0].ravel() == pytest.approx([0.0, 0.0, -0.1 * 0.3], abs=1e-9)

    def test_first_frame_and_a_repeated_one_have_no_interval(self) -> None:
        ego = calibrated()
        feed(ego, np.arange(0, 1, 0.01), gyro=lambda _: RATE)
        first, _, again = ego.advance(ns(0.1)), ego.advance(ns(0.2)), ego.advance(ns(0.2))
        assert "first frame" in first.notes
        assert again.notes == ("no speed",)
        for motion in (first, again):
            assert (motion.dt_s, motion.rotation_sigma_rad) == (0.0, 0.0)
            np.testing.assert_array_equal(motion.rotation, np.eye(3))

    def test_frame_that_goes_back_is_counted_and_changes_nothing(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 1, 0.01), gyro=lambda _: RATE)
        ego.advance(ns(0.5))
        assert ego.advance(ns(0.3)).dt_s == 0.0
        assert ego.refused["frame stamp goes back"] == 1
        assert ego.advance(ns(0.6)).dt_s == pytest.approx(0.1)


class TestUncertainty:
    def test_grows_with_noise_and_interval(self) -> None:
        quiet, noisy = calibrated(Imu(gyro_noise_radps=0.001)), calibrated(Imu(gyro_noise_radps=0.01))
        for ego in (quiet, noisy):
            feed(ego, np.arange(0, 1, 0.01), gyro=lambda _: RATE)
            ego.advance(ns(0.1))
        short, long = noisy.advance(ns(0.2)), noisy.advance(ns(0.6))
        assert short.rotation_sigma_rad == pytest.approx(0.01 * (0.1 + np.sqrt(0.1 * 0.01)), rel=0.002)
        assert quiet.advance(ns(0.2)).rotation_sigma_rad == pytest.approx(short.rotation_sigma_rad / 10, rel=0.1)
        assert long.rotation_sigma_rad > short.rotation_sigma_rad

    def test_a_bias_that_is_unknown_is_part_of_it_and_reported(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 1, 0.01), gyro=lambda _: RATE)
        ego.advance(ns(0.1))
        motion = ego.advance(ns(0.2))
        assert motion.rotation_sigma_rad == pytest.approx(0.2 * 0.1, rel=0.01)
        assert "gyro bias unknown" in motion.notes
        ego.bias.see_rest(np.zeros(3), 0.02)
        motion = ego.advance(ns(0.3))
        assert motion.rotation_sigma_rad == pytest.approx(np.hypot(0.02, 0.005 * np.sqrt(0.1)) * 0.1, rel=0.01)
        assert "gyro bias unknown" not in motion.notes

    def test_held_sample_widens(self) -> None:
        ego = calibrated()
        feed(ego, np.arange(0, 0.181, 0.01), gyro=lambda _: RATE)
        ego.advance(ns(0.1))
        motion = ego.advance(ns(0.2))
        np.testing.assert_allclose(motion.rotation, turned_by(np.array(RATE) * 0.1), atol=1e-9)
        measured = 0.005 * (0.1 + np.sqrt(0.1 * 0.01))
        assert motion.rotation_sigma_rad == pytest.approx(measured + 0.05 * 0.02, rel=0.002)
        assert "imu gap" not in motion.notes

    @pytest.mark.parametrize("missing", [(0.13, 0.21), (0.15, 0.31)], ids=["inside", "up to the end"])
    def test_gap_is_noted_and_widens(self, missing: tuple[float, float]) -> None:
        ego = estimator()
        times = np.arange(0, 0.3, 0.01)
        feed(ego, times[(times < missing[0]) | (times > missing[1])], gyro=lambda _: RATE)
        ego.advance(ns(0.1))
        motion = ego.advance(ns(0.25))
        assert "imu gap" in motion.notes
        assert motion.rotation_sigma_rad > 0.1 * 0.08
        np.testing.assert_allclose(motion.rotation, turned_by(np.array(RATE) * 0.15), atol=1e-9)

    def test_saturated_samples_are_noted_counted_and_widen(self) -> None:
        clean, clipped = calibrated(), calibrated()
        for number, t in enumerate(np.arange(0, 0.3, 0.01)):
            for ego in (clean, clipped):
                ego.add_imu(ImuSample(ns(t), RATE, LEVEL, saturated=ego is clipped and number in (14, 15)))
        trusted, doubted = ([ego.advance(ns(t)) for t in (0.1, 0.2, 0.29)] for ego in (clean, clipped))
        assert [motion.notes[:1] for motion in doubted[1:]] == [("imu saturated",), ("no speed",)]
        wider_rad = doubted[1].rotation_sigma_rad - trusted[1].rotation_sigma_rad
        assert wider_rad == pytest.approx(1.0 * 0.02, rel=0.002)
        assert doubted[2].rotation_sigma_rad == trusted[2].rotation_sigma_rad
        np.testing.assert_array_equal(doubted[1].rotation, trusted[1].rotation)
        assert clipped.refused == {"imu saturated": 2}

    def test_imu_that_ended_is_no_imu(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 0.3, 0.01), gyro=lambda _: RATE)
        ego.advance(ns(1.0))
        motion = ego.advance(ns(1.1))
        assert "no imu" in motion.notes
        np.testing.assert_array_equal(motion.rotation, np.eye(3))
        assert motion.rotation_sigma_rad == pytest.approx(0.1 * 0.1)

    def test_without_imu_odometry_gives_the_turn(self) -> None:
        ego = estimator()
        for t in np.arange(0, 1, 0.1):
            ego.add_speed(SpeedSample(ns(t), 1.0, 0.4))
        ego.advance(ns(0.5))
        motion = ego.advance(ns(0.6))
        assert motion.notes == ("no imu", "rotation from odometry")
        np.testing.assert_allclose(motion.rotation, turned_by((0.0, -0.04, 0.0)), atol=1e-9)
        assert motion.rotation_sigma_rad == pytest.approx(0.1 * 0.1)  # of pitch and roll it says nothing

    def test_without_imu_and_yaw_nothing_turns(self) -> None:
        ego = estimator()
        ego.add_speed(SpeedSample(ns(0.5), 1.0, nan))
        ego.advance(ns(0.5))
        motion = ego.advance(ns(0.6))
        assert motion.notes == ("no imu",)
        assert (motion.yaw_rate_radps, motion.speed_mps) == (0.0, 1.0)
        np.testing.assert_array_equal(motion.rotation, np.eye(3))

    def test_frames_seconds_apart_integrate_what_there_is(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 4, 0.01), gyro=lambda _: RATE)
        ego.advance(ns(0.5))
        motion = ego.advance(ns(3.5))
        np.testing.assert_allclose(motion.rotation, turned_by(np.array(RATE) * 3.0), atol=1e-9)
        assert "imu gap" not in motion.notes


BIAS = (0.02, -0.03, 0.01)


def ground_of(speed_mps: float, window_s: float) -> GroundSpeed:
    ground = GroundSpeed()
    ground.speed_mps, ground.sigma_mps, ground.elapsed_s = speed_mps, 0.06 * speed_mps, window_s
    return ground


def about(bias: GyroBias, truth: Iterable[float], sigmas: float = 3.0) -> bool:
    """Whether the truth lies within the sigmas that are stated."""
    return bool((np.abs(bias.mean_radps - np.array(list(truth))) <= sigmas * bias.sigma_radps).all())


def untouched(bias: GyroBias) -> bool:
    return not bias.mean_radps.any() and bool((bias.sigma_radps >= PRIOR_RADPS).all())


class TestBias:
    def test_is_learnt_at_rest_and_then_taken_out(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 1, 0.01), gyro=lambda _: BIAS)
        for t in (0.3, 0.6, 0.9):
            ego.advance(ns(t))
        assert about(ego.bias, BIAS)
        assert (ego.bias.sigma_radps < 0.002).all()
        np.testing.assert_allclose(ego.bias.mean_radps, BIAS, atol=1e-5)
        feed(ego, np.arange(1, 2, 0.01), gyro=lambda _: tuple(np.add(BIAS, RATE)))
        ego.advance(ns(1.2031))
        motion = ego.advance(ns(1.2777))
        np.testing.assert_allclose(motion.rotation, turned_by(np.array(RATE) * motion.dt_s), atol=1e-6)
        assert motion.yaw_rate_radps == pytest.approx(0.7, abs=1e-5)

    def test_is_an_average_over_noisy_rests(self) -> None:
        ego, random = estimator(), np.random.default_rng(0)
        for t in np.arange(0, 10, 0.05):
            feed(ego, t + np.arange(0, 0.05, 0.005), gyro=lambda _: tuple(random.normal(BIAS, 0.004)))
            ego.advance(ns(t + 0.045))
        assert about(ego.bias, BIAS)
        np.testing.assert_allclose(ego.bias.mean_radps, BIAS, atol=2e-3)

    @pytest.mark.parametrize("rest_by", ["odometry", "image"])
    @pytest.mark.parametrize("bias", [BIAS, (0.35, -0.35, 0.35)], ids=["small", "20 degrees a second"])
    def test_is_learnt_at_rest_although_motors_shake_the_vehicle(
        self, rest_by: str, bias: tuple[float, float, float]
    ) -> None:
        ego, random = estimator(), np.random.default_rng(0)
        for t in np.arange(0, 3, 0.05):
            feed(
                ego,
                t + np.arange(0, 0.05, 0.005),
                gyro=lambda _: tuple(random.normal(bias, 0.05)),
                accel=lambda _: tuple(random.normal(LEVEL, 1.3)),
            )
            if rest_by == "odometry":
                ego.add_speed(SpeedSample(ns(t), 0.0, 0.0))
            motion = ego.advance(ns(t + 0.045), still=t > 0.5 if rest_by == "image" else None)
        assert about(ego.bias, bias)
        assert ego.bias.known
        assert motion.speed_mps == 0.0
        assert not motion.notes

    @pytest.mark.parametrize(
        ("gyro", "accel"),
        [
            ((0.0, 0.15, 0.0), LEVEL),  # a steady turn
            ((0.0, 0.03, 0.0), (0.0, -11.0, 0.0)),  # more than gravity acts
        ],
    )
    def test_is_not_learnt_from_steady_motion(
        self, gyro: tuple[float, float, float], accel: tuple[float, float, float]
    ) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 1, 0.01), gyro=lambda _: gyro, accel=lambda _: accel)
        ego.advance(ns(0.9))
        assert untouched(ego.bias)

    def test_is_not_learnt_from_a_slow_turn_once_it_is_known(self) -> None:
        ego = calibrated()
        feed(ego, np.arange(0, 1, 0.01), gyro=lambda _: (0.0, 0.04, 0.0))
        ego.advance(ns(0.8))
        ego.advance(ns(0.9))
        assert not ego.bias.mean_radps.any()

    def test_is_not_learnt_while_the_image_moves(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 1, 0.01), gyro=lambda _: BIAS)
        ego.advance(ns(0.9), still=False)
        assert untouched(ego.bias)

    def test_is_not_learnt_while_the_flow_shows_that_it_drives_however_quiet_the_imu_is(self) -> None:
        """As on a smooth floor at a steady speed. Half a second after the flow has stopped it rests."""
        ego = calibrated()
        feed(ego, np.arange(0, 3, 0.01), gyro=lambda _: (0.0, 0.005, 0.0))
        seen: list[tuple[float, bool]] = []
        for t in np.arange(0.1, 3, 0.05):
            motion = ego.advance(ns(t))
            ego.see_driving(bool(t < 1.5))
            seen.append((t, motion.speed_mps == 0.0))
        assert not any(rests for t, rests in seen if 0.7 < t < 1.9)
        assert all(rests for t, rests in seen if t > 2.1)

    @pytest.mark.parametrize(
        ("noise_mps2", "still", "rests"), [(0.0, False, False), (0.02, False, True), (0.0, None, True)]
    )
    def test_a_simulated_imu_without_noise_shows_no_rest_while_the_image_moves(
        self, noise_mps2: float, still: bool | None, rests: bool
    ) -> None:
        """At any steady speed it is as quiet as at rest."""
        ego = calibrated()
        noise = iter(np.random.default_rng(0).normal(0, noise_mps2, 200).tolist())
        feed(ego, np.arange(0, 2, 0.01), accel=lambda _: (next(noise), LEVEL[1], 0.0))
        for t in np.arange(0.1, 2, 0.05):
            motion = ego.advance(ns(t), still=still)
        assert (motion.speed_mps == 0.0) == rests

    def test_a_quiet_imu_is_no_rest_before_images_could_show_whether_the_vehicle_drives(self) -> None:
        """The IMU is read before the first image comes: whoever starts it while driving smoothly has no speed of 0."""
        ego = calibrated()
        feed(ego, np.arange(0, 3, 0.01))
        rests = {t: ego.advance(ns(t)).speed_mps == 0 for t in (1.0, 1.1, 1.4, 1.6)}
        assert rests == {1.0: False, 1.1: False, 1.4: False, 1.6: True}

    @pytest.mark.parametrize("forward_mps2", [0.0, 0.6], ids=["too gently to be measured", "measurably"])
    def test_the_speed_of_a_start_is_unknown_only_if_the_accelerometer_missed_it(self, forward_mps2: float) -> None:
        """It rests for a second; half a second after the flow has begun it drives at a steady speed."""
        ego = calibrated()
        feed(ego, np.arange(0, 6, 0.01), accel=lambda t: (0.0, LEVEL[1], forward_mps2 if 1.0 <= t < 1.5 else 0.0))
        for t in np.arange(0.1, 6, 0.05):
            motion = ego.advance(ns(t))
            ego.see_driving(bool(t > 1.0))
        if forward_mps2:
            assert motion.speed_mps == pytest.approx(0.3, abs=0.1)
        else:
            assert np.isnan(motion.speed_mps)
            assert "no speed" in motion.notes

    def test_a_steady_acceleration_is_no_rest_where_the_ground_shows_the_speed(self) -> None:
        """The IMU is as quiet as at rest."""
        for is_shown in (False, True):
            ego = calibrated()
            feed(ego, np.arange(0, 2, 0.01), accel=lambda _: (0.0, LEVEL[1], 1.0))
            for t in np.arange(0.1, 2, 0.05):
                ego.advance(ns(t))
                if is_shown:
                    ego.see_ground(ground_of(0.6, 0.2))
            assert (ego.advance(ns(2.0)).speed_mps != 0) == is_shown

    @pytest.mark.parametrize(("flows_s", "is_known"), [(0.4, True), (0.7, False)])
    def test_the_speed_0_of_a_rest_is_discarded_after_half_a_second_of_flow(
        self, flows_s: float, is_known: bool
    ) -> None:
        """What comes close to a stationary vehicle may flow outward for a moment."""
        ego = calibrated()
        feed(ego, np.arange(0, 2, 0.01))
        for t in np.arange(0.1, 1.0 + flows_s, 0.05):
            motion = ego.advance(ns(t))
            ego.see_driving(bool(t > 1.0))
        motion = ego.advance(ns(1.0 + flows_s))
        assert np.isfinite(motion.speed_mps) == is_known

    @pytest.mark.parametrize(("speed", "yaw"), [(0.5, 0.0), (0.0, 0.05)], ids=["drives", "turns on the spot"])
    def test_is_not_learnt_while_odometry_moves(self, speed: float, yaw: float) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 1, 0.01), gyro=lambda _: BIAS)
        for t in np.arange(0, 1, 0.05):
            ego.add_speed(SpeedSample(ns(t), speed, yaw))
        ego.advance(ns(0.9))
        assert untouched(ego.bias)

    def test_is_not_learnt_from_a_shaken_vehicle_of_which_nothing_says_that_it_stands(self) -> None:
        ego, random = estimator(), np.random.default_rng(0)
        feed(
            ego,
            np.arange(0, 1, 0.01),
            accel=lambda _: tuple(random.normal(LEVEL, 0.5)),
            gyro=lambda _: tuple(random.normal(BIAS, 1e-4)),
        )
        ego.advance(ns(0.9))
        assert untouched(ego.bias)

    def test_needs_half_a_second(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 0.45, 0.01), gyro=lambda _: BIAS)
        ego.advance(ns(0.44))
        assert untouched(ego.bias)

    def test_is_learnt_from_the_rotation_that_the_flow_takes_out(self) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 5, 0.01), gyro=lambda t: tuple(np.add(BIAS, np.multiply(RATE, np.sin(t)))))
        ego.advance(ns(0.0))
        for t in np.arange(1, 90) * 0.05:
            motion = ego.advance(ns(t), still=False)
            truth = turned_by(np.array(RATE) * (np.cos(t - 0.05) - np.cos(t)))
            missed = cv2.Rodrigues(truth @ motion.rotation.T)[0].ravel()
            ego.correct(missed, np.full(3, 3e-4))
        assert about(ego.bias, BIAS)
        np.testing.assert_allclose(ego.bias.mean_radps, BIAS, atol=2e-3)
        assert motion.rotation_sigma_rad < 0.05 * 0.015


class TestGyroForYawAlone:
    """Its driver reports 0 about the other axes, since the message has three."""

    def gyro(self, t: float) -> tuple[float, float, float]:
        return (0.0, 0.3 + 0.01 * np.sin(50 * t), 0.0)

    def turning(self, gyro: Callable[[float], tuple[float, float, float]]) -> tuple[EgoMotionEstimator, EgoMotion]:
        ego = calibrated()
        feed(ego, np.arange(0, 1, 0.01), gyro=gyro)
        ego.advance(ns(0.5))
        return ego, ego.advance(ns(0.6))

    def test_what_it_does_not_measure_is_noted_and_uncertain(self) -> None:
        _, yaw_alone = self.turning(self.gyro)
        _, whole = self.turning(lambda t: (1e-6, self.gyro(t)[1], -1e-6))
        assert "gyro lacks an axis" in yaw_alone.notes
        assert "gyro lacks an axis" not in whole.notes
        np.testing.assert_allclose(yaw_alone.rotation, whole.rotation, atol=1e-6)
        assert yaw_alone.rotation_sigma_rad == pytest.approx(np.deg2rad(1.0) * 0.1, rel=0.01)
        assert yaw_alone.rotation_sigma_rad > 1.5 * whole.rotation_sigma_rad

    def test_the_image_shows_it(self) -> None:
        ego, _ = self.turning(self.gyro)
        pitch_rad, sigma_rad = 0.005, 0.0005
        seen = ego.add_image_rotation(np.array([pitch_rad, -0.03, 0.0]), np.full(3, sigma_rad))
        share = 1 / (1 + (sigma_rad / np.deg2rad(0.1)) ** 2)  # by their variances
        np.testing.assert_allclose(seen.rotation, turned_by((-share * pitch_rad, 0.03, 0.0)), atol=2e-4)
        assert ego.bias.known
        assert ego.bias.mean_radps[0] == 0.0  # no bias of what it does not measure

    def test_at_rest_all_axes_may_be_0(self) -> None:
        _, motion = self.turning(lambda _: (0.0, 0.0, 0.0))
        assert "gyro lacks an axis" not in motion.notes


class TestBrokenGyro:
    def alive(self, t: float) -> tuple[float, float, float]:
        return (0.0, 0.6 + 0.001 * np.sin(997 * t), 0.0)

    def test_one_that_had_noise_and_sticks_is_reported_and_not_used(self) -> None:
        ego, random = calibrated(), np.random.default_rng(0)
        feed(
            ego,
            np.arange(0, 2, 0.01),
            gyro=lambda t: self.alive(min(t, 1.0)),
            accel=lambda _: tuple(random.normal(LEVEL, 0.1)),
        )
        ego.advance(ns(0.95))
        before, after = ego.advance(ns(1.0)), [ego.advance(ns(t)) for t in (1.2, 1.5, 1.6)][-1]
        assert "gyro stuck" not in before.notes
        assert "gyro stuck" in after.notes
        assert after.rotation_sigma_rad == pytest.approx(0.1 * 0.1)
        assert after.rotation_sigma_rad > 5 * before.rotation_sigma_rad / 0.05 * 0.1
        assert after.yaw_rate_radps == pytest.approx(before.path_yaw_rate_radps, abs=0.2)  # it goes on as it went

    def test_the_image_gives_the_rotation_when_the_gyro_died(self) -> None:
        ego = calibrated()
        feed(ego, np.arange(0, 1, 0.01), gyro=self.alive)
        ego.advance(ns(1.4))
        assert "no imu" in ego.advance(ns(1.5)).notes
        motion = ego.add_image_rotation(np.array([0.0, -0.06, 0.0]), np.full(3, 0.002))
        assert "rotation from pictures" in motion.notes
        np.testing.assert_allclose(motion.rotation, turned_by((0.0, 0.06, 0.0)), atol=1e-3)
        assert motion.rotation_sigma_rad == pytest.approx(0.002, rel=0.1)
        assert motion.yaw_rate_radps == pytest.approx(-0.6, abs=0.02)

    def test_an_image_does_not_overrule_a_gyro_that_is_known(self) -> None:
        ego = calibrated()
        feed(ego, np.arange(0, 1, 0.01), gyro=self.alive)
        ego.advance(ns(0.5))
        rest_by = ego.advance(ns(0.55))
        seen = ego.add_image_rotation(np.array([0.0, 0.08, 0.0]), np.full(3, 0.002))
        np.testing.assert_array_equal(seen.rotation, rest_by.rotation)
        assert ego.bias.known

    def test_a_gyro_that_images_refute_for_a_second_is_unknown_again(self) -> None:
        ego = calibrated()
        feed(ego, np.arange(0, 3, 0.01), gyro=self.alive)
        ego.advance(ns(0.5))
        for t in 0.5 + np.arange(1, 30) * 0.05:
            ego.advance(ns(t))
            ego.add_image_rotation(np.array([0.0, -0.045, 0.0]), np.full(3, 0.002))  # 0.9 rad/s: the bias is -0.3
        assert ego.bias.mean_radps[1] == pytest.approx(-0.3, abs=0.02)


class Drive:
    """Stands 1 s, gains speed for 2 s, cruises 1 s, brakes for 2 s, stands; the camera nods meanwhile."""

    pitch_rad = 0.1
    nod_rad = 0.05

    def acceleration(self, t: float) -> float:
        return 0.8 * (float(1 <= t < 3) - float(4 <= t < 6))

    def speed(self, t: float) -> float:
        return float(0.8 * (np.clip(t - 1, 0, 2) - np.clip(t - 4, 0, 2)))

    def pitch(self, t: float) -> float:
        return float(self.pitch_rad + self.nod_rad * np.sin(3 * np.clip(t - 1, 0, 5)) ** 2)

    def gyro(self, t: float) -> tuple[float, float, float]:
        moving = 1 <= t < 6
        return (self.nod_rad * 3 * np.sin(6 * (t - 1)) * moving, 1e-9, 1e-9)  # about x: looking up is positive

    def accel(self, t: float) -> tuple[float, float, float]:
        c, s = np.cos(self.pitch(t)), np.sin(self.pitch(t))
        forward, up = self.acceleration(t), G
        return (0.0, -c * up + s * forward, s * up + c * forward)

    def play(self, ego: EgoMotionEstimator, until_s: float = 8.0) -> Iterator[tuple[float, EgoMotion]]:
        for k in range(1, round(until_s / 0.05)):
            t = k * 0.05
            feed(ego, t - 0.05 + np.arange(1, 11) * 0.005, self.gyro, self.accel)
            yield t, ego.advance(ns(t))

    def run(self, ego: EgoMotionEstimator, until_s: float = 8.0) -> list[tuple[float, EgoMotion]]:
        return list(self.play(ego, until_s))


class TestSpeedByAccelerometer:
    def test_follows_a_drive_with_pitch_and_gravity(self) -> None:
        drive = Drive()
        for t, motion in drive.run(estimator(speed_source="imu"))[20:]:
            assert motion.speed_mps == pytest.approx(drive.speed(t - 0.025), abs=0.05), t
            if 1.1 < t < 5.9:
                assert motion.notes == ("speed drifts",)

    def test_its_note_says_whether_the_ground_corrects_it(self) -> None:
        ego = estimator(speed_source="imu")
        notes = []
        for t, motion in Drive().play(ego, 4.0):
            notes.append((t, motion.notes))
            if t < 2.0:
                ego.see_ground(ground_of(motion.speed_mps, 0.2))
        assert all(note == ("speed from ground",) for t, note in notes if 1.2 < t < 2.9)
        assert all(note == ("speed drifts",) for t, note in notes if t > 3.1)

    def test_is_zero_again_after_the_stop(self) -> None:
        motions = Drive().run(estimator(speed_source="imu"))
        assert motions[-1][1].speed_mps == 0.0
        assert motions[-1][1].notes == ()

    def test_auto_uses_it_when_nothing_better_is_there(self) -> None:
        assert Drive().run(estimator(), 3.0)[-1][1].speed_mps == pytest.approx(1.56, abs=0.05)

    def test_is_unknown_before_the_first_rest(self) -> None:
        ego = estimator(speed_source="imu")
        feed(ego, np.arange(0, 0.3, 0.01))
        ego.advance(ns(0.1))
        motion = ego.advance(ns(0.2))
        assert isnan(motion.speed_mps)
        assert motion.notes == ("gyro bias unknown", "no speed")

    def test_drift_is_bounded_in_time(self) -> None:
        ego, random = estimator(speed_source="imu"), np.random.default_rng(0)
        Drive().run(ego, 3.0)
        known_s = []
        for t in np.arange(3.0, 20.0, 0.05):  # rattles on without a stop
            feed(
                ego,
                t + np.arange(1, 11) * 0.005,
                gyro=lambda _: tuple(random.normal(0, 1e-3, 3)),
                accel=lambda _: tuple(random.normal(LEVEL, 1.0)),
            )
            motion = ego.advance(ns(t + 0.05))
            if not isnan(motion.speed_mps):
                known_s.append(t)
        assert 6.0 < max(known_s) < 10.0
        assert motion.notes == ("no speed",)

    def test_is_unknown_after_a_gap_of_seconds_until_the_next_rest(self) -> None:
        ego = estimator(speed_source="imu")
        Drive().run(ego, 3.0)
        feed(ego, np.arange(6, 6.3, 0.005))
        assert isnan(ego.advance(ns(6.2)).speed_mps)
        feed(ego, np.arange(6.3, 7, 0.005))
        assert ego.advance(ns(6.95)).speed_mps == 0.0


class TestSpeedByOdometry:
    def fed(self, **vehicle: object) -> EgoMotionEstimator:
        ego = estimator(**vehicle)
        for t in np.arange(0, 1.01, 0.2):
            ego.add_speed(SpeedSample(ns(t), 1.0 + 2 * t, 0.0))
        return ego

    @pytest.mark.parametrize("source", ["auto", "odometry", "zenoh"])
    def test_is_interpolated_and_averaged(self, source: str) -> None:
        ego = self.fed(speed_source=source, speed_mps=9.0)
        ego.advance(ns(0.33))
        assert ego.advance(ns(0.71)).speed_mps == pytest.approx(1.0 + 2 * 0.52)

    def test_latest_is_held_half_a_second_and_then_stale(self) -> None:
        ego = self.fed(speed_source="odometry")
        ego.advance(ns(1.4))
        assert ego.advance(ns(1.49)).speed_mps == pytest.approx(3.0)
        stale = ego.advance(ns(1.52))
        assert isnan(stale.speed_mps)
        assert "no speed" in stale.notes

    def test_auto_falls_back_to_the_constant(self) -> None:
        ego = self.fed(speed_mps=9.0)
        ego.advance(ns(1.4))
        assert ego.advance(ns(1.6)).speed_mps == 9.0

    def test_accelerometer_goes_on_when_odometry_ends(self) -> None:
        drive, ego = Drive(), estimator()
        for t in np.arange(0, 2.0, 0.05):
            ego.add_speed(SpeedSample(ns(t), drive.speed(t), nan))
        motion = drive.run(ego, 3.0)[-1][1]
        assert "speed drifts" in motion.notes
        assert motion.speed_mps == pytest.approx(drive.speed(2.95), abs=0.1)

    @pytest.mark.parametrize("source", ["constant", "none"])
    def test_other_sources_do_not_ask_it(self, source: str) -> None:
        ego = self.fed(speed_source=source, speed_mps=9.0)
        ego.advance(ns(0.3))
        motion = ego.advance(ns(0.7))
        assert motion.speed_mps == 9.0 if source == "constant" else isnan(motion.speed_mps)
        assert ("no speed" in motion.notes) == (source == "none")


class TestRefusal:
    @pytest.mark.parametrize(
        ("gyro", "accel", "reason"),
        [
            ((nan, 0.0, 0.0), LEVEL, "imu not finite"),
            (RATE, (0.0, inf, 0.0), "imu not finite"),
            ((0.0, 41.0, 0.0), LEVEL, "imu out of range"),
            (RATE, (201.0, 0.0, 0.0), "imu out of range"),
        ],
    )
    def test_bad_imu_sample_is_counted_and_harmless(
        self, gyro: tuple[float, float, float], accel: tuple[float, float, float], reason: str
    ) -> None:
        ego = estimator()
        feed(ego, np.arange(0, 0.1, 0.01), gyro=lambda _: RATE)
        ego.add_imu(ImuSample(ns(0.105), gyro, accel))
        feed(ego, np.arange(0.11, 0.3, 0.01), gyro=lambda _: RATE)
        ego.advance(ns(0.05))
        np.testing.assert_allclose(ego.advance(ns(0.2)).rotation, turned_by(np.array(RATE) * 0.15), atol=1e-9)
        assert ego.refused == {reason: 1}

    @pytest.mark.parametrize(
        ("sample", "reason"),
        [
            (SpeedSample(ns(0.7), nan, 0.0), "speed not finite"),
            (SpeedSample(ns(0.7), -71.0, 0.0), "speed out of range"),
            (SpeedSample(ns(0.7), 1.0, inf), "speed out of range"),
            (SpeedSample(ns(0.5), 1.0, 0.0), "speed stamp goes back"),
            (SpeedSample(2**63, 1.0, 0.0), "speed out of range"),
        ],
    )
    def test_bad_speed_sample_is_counted_and_harmless(self, sample: SpeedSample, reason: str) -> None:
        ego = estimator()
        ego.add_speed(SpeedSample(ns(0.6), 2.0, 0.0))
        ego.add_speed(sample)
        ego.advance(ns(0.6))
        assert ego.advance(ns(0.8)).speed_mps == 2.0
        assert ego.refused == {reason: 1}

    def test_stamps_that_repeat_or_go_back_are_counted(self) -> None:
        ego = estimator()
        feed(ego, [0.0, 0.01, 0.01, 0.005, 0.02])
        assert ego.refused == {"imu stamp goes back": 2}

    def test_one_stamp_far_ahead_does_not_shut_out_the_rest(self) -> None:
        ego = calibrated()
        feed(ego, [0.0, 1000.0, *np.arange(0.01, 0.5, 0.01)], gyro=lambda _: RATE)
        ego.advance(ns(0.2))
        motion = ego.advance(ns(0.3))
        np.testing.assert_allclose(motion.rotation, turned_by(np.array(RATE) * 0.1), atol=1e-9)
        assert motion.notes == ("no speed",)
        assert ego.refused == {"imu stamp goes back": 4}

    def test_memory_is_fixed_and_what_was_missed_is_counted(self) -> None:
        ego = estimator()
        ego.advance(ns(0.0))
        feed(ego, np.arange(1, 3 * IMU_CAPACITY + 1) * 0.001, gyro=lambda _: RATE)
        kept = 3 * IMU_CAPACITY - ego.refused["imu overflow"]
        assert IMU_CAPACITY // 2 <= kept <= IMU_CAPACITY
        motion = ego.advance(ns(3.072))
        assert "imu gap" in motion.notes
        assert motion.rotation_sigma_rad > 0.1 * 2.0

    def test_used_samples_leave_uncounted(self) -> None:
        ego = estimator()
        for k in range(1, 40):
            feed(ego, (k - 1) * 0.1 + np.arange(1, 101) * 0.001)
            ego.advance(ns(k * 0.1))
        assert not ego.refused


anything = st.floats(allow_nan=True, allow_infinity=True)
stamps = st.integers(-(10**9), 10**10) | st.integers(-(2**64), 2**64)
events = st.one_of(
    st.builds(ImuSample, stamps, st.tuples(*[anything] * 3), st.tuples(*[anything] * 3), st.booleans()),
    st.builds(ImuSample, stamps, st.tuples(*[st.floats(-20, 20)] * 3), st.tuples(*[st.floats(-100, 100)] * 3)),
    st.builds(SpeedSample, stamps, anything, anything),
    st.builds(SpeedSample, stamps, st.floats(-60, 60), st.floats(-3, 3)),
    st.integers(-(10**9), 10**11),
)


@given(st.lists(events, max_size=60), st.sampled_from(["auto", "odometry", "imu", "none"]))
@settings(max_examples=150, deadline=None)
def test_any_order_and_garbage_give_a_rotation_and_bounded_numbers(
    happenings: list[ImuSample | SpeedSample | int], source: str
) -> None:
    ego = estimator(speed_source=source)
    for event in happenings:
        if isinstance(event, ImuSample):
            ego.add_imu(event)
        elif isinstance(event, SpeedSample):
            ego.add_speed(event)
        else:
            motion = ego.advance(event)
            np.testing.assert_allclose(motion.rotation @ motion.rotation.T, np.eye(3), atol=1e-9)
            assert np.linalg.det(motion.rotation) == pytest.approx(1.0)
            assert motion.dt_s >= 0
            assert motion.rotation_sigma_rad >= 0
            assert isnan(motion.speed_mps) == ("no speed" in motion.notes)
            assert isnan(motion.speed_mps) or abs(motion.speed_mps) <= 75
            assert abs(motion.yaw_rate_radps) <= 41
