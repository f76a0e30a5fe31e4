"""The filter of the gyro's bias, on rates that are known exactly."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcf_edge.ego_motion.axis_bias import PRIOR_RADPS
from lcf_edge.ego_motion.gyro_bias import KNOWN_RADPS, GyroBias

DT_S = 0.05
NOISE_RADPS = 0.006
TWENTY_DEGREES_PER_S = np.radians(20)


def drive(
    bias: GyroBias,
    truth_radps: np.ndarray,
    seconds: float,
    random: np.random.Generator,
    flow_sigma_radps: float = 0.01,
    drift_radps2: float = 0.0,
    dt_s: float = DT_S,
) -> tuple[np.ndarray, np.ndarray]:
    """Learn the rate from the flow; errors and sigmas, (frames, 3) each."""
    errors, sigmas = [], []
    for frame in range(round(seconds / dt_s)):
        true = truth_radps + drift_radps2 * frame * dt_s
        bias.advance(dt_s, np.full(3, NOISE_RADPS), measured=(True, True, True))
        seen = true + random.normal(0, NOISE_RADPS, 3) + random.normal(0, flow_sigma_radps, 3)
        bias.see_flow(seen, np.full(3, flow_sigma_radps), 0.0)
        errors.append(bias.mean_radps - true)
        sigmas.append(bias.sigma_radps)
    return np.array(errors), np.array(sigmas)


def test_nothing_is_known_at_first_and_twenty_degrees_a_second_are_no_surprise() -> None:
    bias = GyroBias()
    assert not bias.known
    assert not bias.mean_radps.any()
    assert (2 * bias.sigma_radps > TWENTY_DEGREES_PER_S).all()


@pytest.mark.parametrize("size_radps", [0.0, 0.03, 0.08, TWENTY_DEGREES_PER_S])
def test_a_bias_is_found_within_the_stated_sigma(size_radps: float) -> None:
    bias, random = GyroBias(), np.random.default_rng(0)
    truth = size_radps * np.array([1.0, -1.0, 1.0])
    errors, sigmas = drive(bias, truth, 10.0, random)
    assert (np.abs(errors[-1]) < 2 * sigmas[-1]).all()
    assert bias.known
    assert (np.abs(errors[40:]) < 0.012).all()
    assert (sigmas[-1] < 0.012).all()


def test_the_first_observation_weighs_as_variances_say() -> None:
    bias = GyroBias()
    bias.advance(DT_S, np.full(3, 0.03), measured=(True, True, True))
    assert bias.add_image_rotation(np.full(3, 0.1), np.full(3, 0.04))
    weight = PRIOR_RADPS**2 / (PRIOR_RADPS**2 + 0.03**2 + 0.04**2)
    assert bias.mean_radps == pytest.approx(np.full(3, 0.1 * weight), rel=1e-3)
    assert bias.sigma_radps == pytest.approx(np.full(3, PRIOR_RADPS * np.sqrt(1 - weight)), rel=1e-3)
    whole = (PRIOR_RADPS**2 + 0.03**2) / (PRIOR_RADPS**2 + 0.03**2 + 0.04**2)
    assert bias.error_radps == pytest.approx(np.full(3, 0.1 * whole), rel=1e-3)
    assert bias.error_sigma_radps == pytest.approx(np.full(3, 0.04 * np.sqrt(whole)), rel=1e-3)


def test_truth_lies_within_two_sigma_nine_times_in_ten() -> None:
    """Drawn as the model says: bias from the prior, wandering; flow with an error that lasts ten seconds."""
    within = []
    for seed in range(60):
        random = np.random.default_rng(seed)
        bias, truth, shared = GyroBias(), random.normal(0, 0.2, 3), random.normal(0, 0.002, 3)
        for _ in range(200):
            truth = truth + random.normal(0, 1e-3 * np.sqrt(DT_S), 3)
            kept = np.exp(-DT_S / 10)
            shared = kept * shared + random.normal(0, 0.002 * np.sqrt(1 - kept**2), 3)
            bias.advance(DT_S, np.full(3, NOISE_RADPS), measured=(True, True, True))
            bias.see_flow(truth + shared + random.normal(0, np.hypot(NOISE_RADPS, 0.02), 3), np.full(3, 0.02), 0.2)
            within.append(np.abs(bias.mean_radps - truth) <= 2 * bias.sigma_radps)
    assert 0.9 <= np.mean(within) <= 0.99


def test_a_bias_that_drifts_with_temperature_is_followed() -> None:
    drift = 0.03 / 180  # rad/s²: ten degrees within three minutes
    errors, sigmas = drive(GyroBias(), np.full(3, 0.05), 180.0, np.random.default_rng(0), drift_radps2=drift)
    assert (np.abs(errors[200:]) < 2 * sigmas[200:]).mean() > 0.9
    assert np.abs(errors[200:]).max() < 0.015


def test_flow_alone_is_never_believed_beyond_its_own_errors() -> None:
    _, sigmas = drive(GyroBias(), np.zeros(3), 5.0, np.random.default_rng(0), flow_sigma_radps=1e-4)
    assert (sigmas > 0.0015).all()


def test_flow_shows_the_less_the_nearer_things_pass() -> None:
    """Mean V/Z of 2/s, as beside a floor half a metre below: 0.01 rad of error in O are 0.02 rad/s."""
    far, near = GyroBias(), GyroBias()
    for bias, expansion_hz in ((far, 0.1), (near, 2.0)):
        for _ in range(200):
            bias.advance(DT_S, np.full(3, NOISE_RADPS), measured=(True, True, True))
            bias.see_flow(np.full(3, 0.02), np.full(3, 0.005), expansion_hz)
    assert (near.sigma_radps > 4 * far.sigma_radps).all()
    assert (np.abs(near.mean_radps) < 2 * near.sigma_radps).all()


def test_rest_shows_more_than_flow() -> None:
    bias = GyroBias()
    drive(bias, np.full(3, 0.05), 5.0, np.random.default_rng(0))
    bias.advance(DT_S, np.full(3, NOISE_RADPS), measured=(True, True, True))
    assert bias.see_rest(np.full(3, 0.05), 0.001)
    assert bias.mean_radps == pytest.approx(np.full(3, 0.05), abs=5e-4)
    assert (bias.sigma_radps < 0.0011).all()


def test_one_outlier_changes_nothing_and_a_second_of_them_all() -> None:
    bias = GyroBias()
    drive(bias, np.zeros(3), 5.0, np.random.default_rng(0))
    before = bias.mean_radps
    for frame in range(25):
        bias.advance(DT_S, np.full(3, NOISE_RADPS), measured=(True, True, True))
        used = bias.see_flow(np.array([0.0, 0.3, 0.0]), np.full(3, 0.01), 0.0)
        if frame == 0:
            assert not used
            assert (bias.mean_radps == before).all()
    assert used
    assert bias.mean_radps[1] == pytest.approx(0.3, abs=0.02)


def test_without_a_gyro_nothing_is_learnt_of_its_bias() -> None:
    bias = GyroBias()
    bias.advance(DT_S, np.full(3, 0.1), measured=(False, False, False))
    bias.add_image_rotation(np.full(3, 0.2), np.full(3, 0.01))
    assert not bias.mean_radps.any()
    assert bias.sigma_radps == pytest.approx(np.full(3, PRIOR_RADPS))
    assert bias.error_radps == pytest.approx(np.full(3, 0.2), abs=0.01)
    assert bias.error_sigma_radps == pytest.approx(np.full(3, 0.01), rel=0.01)


rates = st.lists(st.floats(-40, 40), min_size=3, max_size=3)
seen = st.tuples(st.sampled_from(["rest", "image", "flow", "doubt"]), rates, st.floats(1e-6, 10), st.booleans())


@given(st.lists(seen, max_size=40), st.floats(0, 10))
@settings(deadline=None)
def test_whatever_is_reported_numbers_stay_finite_and_sigmas_positive_and_bounded(
    inputs: Sequence[tuple[str, list[float], float, bool]], dt_s: float
) -> None:
    bias = GyroBias()
    for what, rate, sigma, measured in inputs:
        bias.advance(dt_s, np.full(3, sigma / 7), (measured, measured, measured))
        if what == "doubt":
            bias.doubt()
        elif what == "rest":
            bias.see_rest(np.array(rate), sigma)
        elif what == "image":
            bias.add_image_rotation(np.array(rate), np.full(3, sigma))
        else:
            bias.see_flow(np.array(rate), np.full(3, sigma), sigma)
        for value in (bias.mean_radps, bias.error_radps):
            assert np.isfinite(value).all()
            assert (np.abs(value) < 100).all()
        for value in (bias.sigma_radps, bias.error_sigma_radps):
            assert (value > 0).all()
        assert (bias.sigma_radps <= PRIOR_RADPS * 1.001).all()
        assert bias.known == bool((bias.sigma_radps <= KNOWN_RADPS).all())
