"""The speed by the accelerometer, from one rest to the next."""

import numpy as np
import pytest

from lcf_edge.ego_motion.inertial_speed import GRAVITY_MPS2, InertialSpeed

FRAME_S = 0.05
STEADY = np.eye(3)
UP = (0.0, -GRAVITY_MPS2, 0.0)  # what an accelerometer shows at rest, in the camera's axes


def forwards(acceleration_mps2: float) -> tuple[float, float, float]:
    return 0.0, -GRAVITY_MPS2, acceleration_mps2


@pytest.mark.parametrize("late_frames", [0, 2, 4])
def test_a_start_that_is_noticed_late_costs_no_speed(late_frames: int) -> None:
    """Rest is reported for some more frames, and its mean force includes the beginning of the acceleration."""
    speed = InertialSpeed(0.001)
    for _ in range(20):
        speed.rest(UP, FRAME_S, UP, STEADY)
    for frame in range(late_frames):
        speed.rest(forwards(0.1 * (frame + 1)), FRAME_S, forwards(1.0), STEADY)
    for _ in range(10):
        speed.advance(FRAME_S, forwards(1.0), STEADY, 0.0)
    assert speed.mean_mps == pytest.approx((late_frames + 9.5) * FRAME_S, rel=0.02)


def test_at_rest_there_is_no_speed() -> None:
    speed = InertialSpeed(0.001)
    for _ in range(20):
        speed.rest(UP, FRAME_S, UP, STEADY)
        assert speed.mean_mps == 0


def test_what_was_measured_long_before_the_end_of_a_rest_is_no_start() -> None:
    speed = InertialSpeed(0.001)
    speed.rest(UP, FRAME_S, forwards(1.0), STEADY)
    for _ in range(20):
        speed.rest(UP, FRAME_S, UP, STEADY)
    speed.advance(FRAME_S, UP, STEADY, 0.0)
    assert speed.mean_mps == pytest.approx(0, abs=1e-9)


def drive(speed: InertialSpeed, accelerations_mps2: list[float], window: int) -> list[float]:
    """Drive, one acceleration a frame; the ground shows the mean speed of the last ``window`` frames. Return errors."""
    true_mps, means, errors = 1.0, [], []
    for acceleration in accelerations_mps2:
        gained_mps = acceleration * FRAME_S
        means.append(true_mps + gained_mps / 2)
        true_mps += gained_mps
        speed.advance(FRAME_S, forwards(acceleration), STEADY, 0.0)
        errors.append(speed.mean_mps - means[-1])
        if len(means) >= window:
            speed.see_mean(float(np.mean(means[-window:])), 0.06 * np.sqrt(window), window * FRAME_S)
    return errors


START_STOP = [-2.0] * 8 + [0.0] * 20 + [1.0] * 16 + [-2.0] * 7 + [0.0] * 10


def test_the_ground_gives_the_speed_of_now_though_it_shows_the_mean_of_a_window() -> None:
    """Daemon started while driving, up found while braking. Without the accelerometer the speed lags by 0.4 m/s."""
    errors = drive(InertialSpeed(0.005), START_STOP, window=8)
    assert np.isnan(errors[:6]).all()
    assert np.abs(errors[20:]).max() < 0.1


def test_the_accelerometers_error_is_learnt_from_odometry() -> None:
    """A slope, or a camera that was tilted since the rest, looks like an acceleration."""
    speed = InertialSpeed(0.005)
    speed.rest(UP, FRAME_S, UP, STEADY)
    for _ in range(200):
        speed.advance(FRAME_S, forwards(0.3), STEADY, 0.0)
        speed.see_odometry(1.0, FRAME_S)
    for _ in range(40):  # two seconds without odometry
        speed.advance(FRAME_S, forwards(0.3), STEADY, 0.0)
    assert speed.mean_mps == pytest.approx(1.0, abs=0.2)  # 1.6 otherwise


def test_a_mean_over_more_than_is_remembered_is_ignored() -> None:
    speed = InertialSpeed(0.005)
    speed.rest(UP, FRAME_S, UP, STEADY)
    speed.advance(FRAME_S, UP, STEADY, 0.0)
    before = speed.sigma_mps
    speed.see_mean(5.0, 0.01, 1.0)
    assert (speed.mean_mps, speed.sigma_mps) == (0.0, before)


def test_up_is_not_found_in_a_force_that_is_not_gravity() -> None:
    speed = InertialSpeed(0.005)
    for _ in range(20):
        speed.advance(FRAME_S, (0.0, 0.0, 0.0), STEADY, 0.0)
        speed.see_mean(1.0, 0.1, FRAME_S)
    assert np.isnan(speed.mean_mps)


def test_a_rest_that_is_interrupted_is_no_motion_by_an_up_of_before() -> None:
    """Up was found while speeding up, and nothing has shown the speed."""
    speed = InertialSpeed(0.005)
    for _ in range(8):
        speed.advance(FRAME_S, forwards(2.0), STEADY, 0.0)
    speed.rest(UP, FRAME_S, UP, STEADY)
    speed.advance(FRAME_S, UP, STEADY, 0.0)
    assert speed.mean_mps == pytest.approx(0, abs=1e-9)
