"""What is believed of an object by its looming, its sideways motion and its foot."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.filter.range_belief import Belief, Evidence, consider, see_ground

HEIGHT_M = 0.3
RANGE, FORWARD, RIGHT, RATE, LATERAL, CLOSEST = range(6)

Situation = Callable[..., Any]


def evidence_of(
    range_m: float, forward_mps: float, right_mps: float, across: float, speed_mps: float, **changes: Any
) -> Evidence:
    """What a thing of no width shows: exact, with small doubts."""
    evidence = Evidence()
    evidence.looming, evidence.reference = (speed_mps - forward_mps) / range_m, speed_mps
    evidence.sideways = right_mps / range_m
    evidence.mm, evidence.qq, evidence.mq = 0.01**2, 0.01**2, 0.0
    evidence.across, evidence.across_sigma, evidence.half_width = across, 0.005, 0.0
    evidence.foot, evidence.foot_sigma = 1 / range_m, 0.03
    for name, value in changes.items():
        setattr(evidence, name, value)
    return evidence


def belief_of(evidence: Evidence, around: Any) -> Belief:
    belief = Belief()
    consider(belief, evidence, around)
    return belief


@pytest.mark.parametrize("range_m", [1.0, 2.5, 6.0])
@pytest.mark.parametrize("speed_mps", [0.5, 2.0, 10.0])
def test_what_stands_has_the_range_of_its_looming(situation: Situation, range_m: float, speed_mps: float) -> None:
    belief = belief_of(evidence_of(range_m, 0, 0, 0.02, speed_mps), situation(speed_mps=speed_mps))
    assert belief.stands > 0.7
    assert belief.mean[RANGE] == pytest.approx(range_m, rel=0.15)
    assert 1 / belief.mean[RATE] == pytest.approx(range_m / speed_mps, rel=0.15)
    assert belief.mean[LATERAL] == pytest.approx(0.02 * range_m, abs=0.05)


@pytest.mark.parametrize("side", [-1, 1])
def test_who_leaves_to_the_side_does_not_stand_and_is_not_met(situation: Situation, side: int) -> None:
    """He walks off at the vehicle's side as fast as the image shows: near things that stand would loom."""
    evidence = evidence_of(5.0, 0.0, 1.2 * side, 0.35 * side, 1.5)
    belief = belief_of(evidence, situation(speed_mps=1.5))
    assert belief.stands < 0.01
    assert belief.met < 0.01
    assert np.sign(belief.mean[RIGHT]) == side
    assert belief.mean[RIGHT] == pytest.approx(1.2 * side, rel=0.3)


def test_what_moves_in_the_image_of_a_vehicle_at_rest_does_not_stand(situation: Situation) -> None:
    belief = belief_of(evidence_of(4.0, -1.0, 0.0, 0.0, 0.0), situation(speed_mps=0.0))
    assert belief.stands < 0.01
    assert belief.mean[FORWARD] < -0.5
    assert 1 / belief.mean[RATE] == pytest.approx(4.0, rel=0.1)


def test_who_crosses_before_the_vehicle_will_be_met(situation: Situation) -> None:
    """At 4 m, 1.6 m to the left, 0.8 m/s to the right: he is in the middle when the vehicle comes, in 2 s."""
    belief = belief_of(evidence_of(4.0, 0.0, 0.8, -0.4, 2.0), situation(speed_mps=2.0))
    assert belief.stands < 0.01
    assert belief.met > 0.8
    assert belief.mean[LATERAL] == pytest.approx(0.0, abs=0.1)


def test_what_keeps_its_distance_goes_ahead(situation: Situation) -> None:
    belief = belief_of(evidence_of(3.0, 2.0, 0.0, 0.0, 2.0), situation(speed_mps=2.0))
    assert belief.mean[FORWARD] == pytest.approx(2.0, rel=0.2)
    assert belief.met < 0.05


@pytest.mark.parametrize(("range_m", "speed_mps"), [(3.2, 1.4), (4.0, 2.0), (5.0, 3.0)])
def test_without_a_foot_he_walks_slowly_rather_than_coming_fast_from_afar(
    situation: Situation, range_m: float, speed_mps: float
) -> None:
    """Far and fast explains what is seen as well: most who walk do so at less than a metre a second."""
    evidence = evidence_of(range_m, 0.2, 0.4, -0.4, speed_mps, mm=0.03**2, qq=0.02**2)
    belief = belief_of(evidence, situation(speed_mps=speed_mps, camera_height_m=0.0))
    assert belief.mean[RANGE] == pytest.approx(range_m, rel=0.15)
    assert belief.mean[FORWARD] > -0.3
    assert belief.sigma[RANGE] < 0.6 * range_m


def test_nothing_stands_deep_under_the_ground(situation: Situation) -> None:
    """It looms as what stands at 12 m, but its foot is seen where the ground is 3 m off: it goes ahead there."""
    evidence = evidence_of(3.0, 1.5, 0.0, 0.0, 2.0)
    belief = belief_of(evidence, situation(speed_mps=2.0))
    assert belief.stands < 0.05
    assert belief.mean[RANGE] == pytest.approx(3.0, rel=0.3)


@pytest.mark.parametrize(("ground_m", "hidden"), [(2.5, True), (1.0, False)], ids=["behind", "before"])
def test_nothing_stands_where_it_would_hide_the_ground_that_is_seen(
    situation: Situation, ground_m: float, hidden: bool
) -> None:
    """Somebody comes, of whom nothing below the knee is seen. He looms as what stands at 1.33 m."""
    evidence, around = evidence_of(4.0, -0.8, 0.0, 0.1, 0.4, foot=1 / 8), situation(speed_mps=0.4)
    stands = belief_of(evidence, around).stands
    for _ in range(8):
        see_ground(evidence, 1 / ground_m)
    belief = belief_of(evidence, around)
    assert stands > 0.5
    assert belief.stands == pytest.approx(0.02 if hidden else stands, abs=0.02)


def test_ground_that_is_seen_between_legs_makes_it_no_less_likely_than_one_in_a_thousand(situation: Situation) -> None:
    evidence, around = evidence_of(4.0, -0.8, 0.0, 0.1, 0.4, foot=1 / 8), situation(speed_mps=0.4)
    stands = []
    for _ in range(16):
        see_ground(evidence, 1 / 2.5)
        stands.append(belief_of(evidence, around).stands)
    assert max(np.diff(stands[:10])) < 0
    assert stands[10] == stands[15] > 0


@pytest.mark.parametrize(("is_cut", "nearer"), [(False, False), (True, True)])
def test_a_foot_beyond_the_image_says_only_that_the_thing_is_no_farther(
    situation: Situation, is_cut: bool, nearer: bool
) -> None:
    """Somebody who crosses, of whom the ground under the lowest edge is 4 m off."""
    evidence = evidence_of(4.0, 0.0, 1.0, 0.0, 1.0, is_cut=is_cut, mm=0.2**2)
    seen = belief_of(evidence_of(4.0, 0.0, 1.0, 0.0, 1.0, mm=0.2**2), situation(speed_mps=1.0))
    cut = belief_of(evidence, situation(speed_mps=1.0))
    assert (cut.mean[RANGE] < 0.9 * seen.mean[RANGE]) == nearer


def test_doubt_of_the_looming_is_doubt_of_the_contact(situation: Situation) -> None:
    around = situation(speed_mps=2.0)
    sure, unsure = (belief_of(evidence_of(5.0, 0, 0, 0.0, 2.0, mm=sigma**2), around) for sigma in (0.01, 0.1))
    assert unsure.sigma[RATE] > 1.5 * sure.sigma[RATE]
    assert unsure.sigma[RANGE] > sure.sigma[RANGE]


def test_a_wide_thing_is_met_with_its_front_and_sooner(situation: Situation) -> None:
    around = situation(speed_mps=2.0)
    narrow, wide = (belief_of(evidence_of(5.0, 0, 0, 0.0, 2.0, half_width=half), around) for half in (0.0, 0.3))
    assert wide.mean[RANGE] < narrow.mean[RANGE]
    assert wide.mean[RATE] > narrow.mean[RATE]
    assert wide.sigma[RATE] > narrow.sigma[RATE]


def test_straight_ahead_the_front_alone_is_seen_and_farther_aside_a_side_too(situation: Situation) -> None:
    around = situation(speed_mps=2.0)
    shares = []
    for across in (0.0, 0.1, 0.4, -0.4):
        belief = belief_of(evidence_of(5.0, 0, 0, across, 2.0, half_width=0.2), around)
        shares.append(belief.mean[RANGE] / belief.middle)
    ahead, beside, aside, other_side = shares
    assert 0.95 < ahead < 1
    assert ahead > beside > aside == other_side > 0.8


def test_who_comes_so_slowly_that_he_seems_to_stand_is_met_when_his_looming_tells(situation: Situation) -> None:
    evidence = evidence_of(4.0, -0.4, 0.0, 0.0, 1.5, mm=0.08**2, foot_sigma=0.01)
    belief = belief_of(evidence, situation(speed_mps=1.5))
    assert belief.stands > 0.5
    assert 1 / belief.mean[RATE] == pytest.approx(4.0 / 1.9, rel=0.08)


def test_looming_belongs_to_the_speed_at_which_it_was_measured(situation: Situation) -> None:
    """The vehicle has braked since from 2 m/s to 1: contact takes twice as long, the range is the same."""
    evidence = evidence_of(5.0, 0, 0, 0.0, 2.0)
    before, after = (belief_of(evidence, situation(speed_mps=speed_mps)) for speed_mps in (2.0, 1.0))
    assert after.mean[RANGE] == pytest.approx(before.mean[RANGE], rel=0.02)
    assert after.mean[RATE] == pytest.approx(before.mean[RATE] / 2, rel=0.05)


@given(st.floats(0, 12), st.floats(0.5, 20))
def test_however_wide_a_box_is_its_front_is_ahead(situation: Situation, half_width: float, range_m: float) -> None:
    """Through a fisheye a box may reach from side to side, 85 degrees off the axis."""
    belief = belief_of(evidence_of(range_m, 0, 0, 0.0, 2.0, half_width=half_width), situation(speed_mps=2.0))
    assert 0 < belief.mean[RANGE] <= belief.middle
    assert belief.sigma[RANGE] > 0
    assert belief.mean[RATE] > 0


def test_a_thing_is_passed_when_its_contact_comes(situation: Situation) -> None:
    belief = belief_of(evidence_of(5.0, 0, 0, 0.3, 2.0), situation(speed_mps=2.0))
    assert belief.mean[CLOSEST] == pytest.approx(1 / belief.mean[RATE], rel=0.05)


@pytest.mark.parametrize("lifted_m", [0.0, 0.4])
def test_a_foot_that_shows_no_edge_lies_below_by_less_than_a_metre(situation: Situation, lifted_m: float) -> None:
    """At rest only the foot shows how far away somebody is who crosses; his lowest edge may be a knee."""
    range_m = 3.0
    foot = (1 - lifted_m / HEIGHT_M) / range_m
    belief = belief_of(evidence_of(range_m, 0.0, 1.0, 0.0, 0.0, foot=foot), situation(speed_mps=0.0))
    off = abs(belief.mean[RANGE] - range_m)
    assert off < 2 * belief.sigma[RANGE]
    assert belief.mean[RANGE] == pytest.approx(range_m, rel=0.15 if lifted_m == 0 else 0.8)


def test_who_changes_his_velocity_with_the_vehicle_is_not_put_behind_his_feet(situation: Situation) -> None:
    """While the vehicle brakes he starts to walk: by how the looming changed, he would be far beyond his feet."""
    changed = {"inverse": 0.4, "inverse_var": 0.1**2}
    evidence = evidence_of(0.6, 0.15, 0.0, 0.0, 0.05, is_cut=True, **changed)
    belief = belief_of(evidence, situation(speed_mps=0.05))
    assert belief.mean[RANGE] < 0.75


def test_a_belief_does_not_jump(situation: Situation) -> None:
    """A poor foot alone says 8 m; before, the thing was at 3 m."""
    around = situation(speed_mps=1.0)
    evidence = evidence_of(8.0, 0.5, 0.0, 0.0, 1.0, foot_sigma=0.2, mm=0.1**2)
    alone = belief_of(evidence, around).mean[RANGE]
    evidence.range_before, evidence.range_doubt = 3.0, 0.2
    assert belief_of(evidence, around).mean[RANGE] < alone


@given(
    looming=st.floats(-5, 5),
    sideways=st.floats(-5, 5),
    across=st.floats(-2, 2),
    sigma=st.floats(1e-3, 2),
    foot=st.floats(-1, 10),
    speed_mps=st.floats(-3, 30),
    yaw_rate_radps=st.floats(-1, 1),
)
def test_whatever_is_measured_the_belief_is_finite_and_probabilities_are(
    situation: Situation,
    looming: float,
    sideways: float,
    across: float,
    sigma: float,
    foot: float,
    speed_mps: float,
    yaw_rate_radps: float,
) -> None:
    evidence = evidence_of(5.0, 0, 0, across, 1.0, looming=looming, sideways=sideways, foot=foot, half_width=0.1)
    evidence.mm = evidence.qq = sigma**2
    belief = belief_of(evidence, situation(speed_mps=speed_mps, yaw_rate_radps=yaw_rate_radps))
    assert 0 <= belief.stands <= 1
    assert -1e-9 <= belief.met <= 1 + 1e-9
    for quantity in (RANGE, FORWARD, RIGHT, RATE):
        assert math.isfinite(belief.mean[quantity])
        assert belief.sigma[quantity] >= 0
    for quantity in (LATERAL, CLOSEST):  # unknown where it goes away
        assert math.isfinite(belief.mean[quantity]) == math.isfinite(belief.sigma[quantity])
    assert belief.mean[RANGE] > 0


def test_what_is_seen_as_small_as_a_hand_is_not_right_in_front(situation: Situation) -> None:
    """Nothing else shows how far away it is."""
    unmeasured: dict[str, Any] = {"mm": 4.0, "qq": 4.0, "is_cut": True, "foot": 0.0}
    small, large = (
        belief_of(evidence_of(0.5, 0, 0, 0.02, 1.0, half_extent=half, **unmeasured), situation(speed_mps=1.0))
        for half in (0.02, 0.5)
    )
    assert small.mean[RANGE] > 2 * large.mean[RANGE]
