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
