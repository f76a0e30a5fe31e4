"""What all edges together show of the camera: rotation, focus, noise."""

import math
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Config, Filter
from lcf_edge.filter import baselines as lines
from lcf_edge.filter import error_matrix, flow_fit, key_frames
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.error_matrix import MotionError
from lcf_edge.filter.flow import Homography, Pinhole
from lcf_edge.filter.flow_fit import FlowFit
from lcf_edge.filter.key_frames import KeyFrames
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import EdgeTable

PINHOLE = Pinhole(500.0, 500.0, 319.5, 239.5)
SETTINGS = Settings(Filter(), PINHOLE)
KEY_FRAMES, KEY_S, SPEED_MPS = 12, 0.06, 2.0
PRIOR_PX = 20.0

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """Landmarks seen from a camera that turns at ``rate_radps`` without anybody knowing, and heads ``focus_px`` beside
    where it should. ``movers``: share that goes its own way; ``body``: instead, the share on one near body that does.
    """

    rate_radps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    focus_px: tuple[float, float] = (0.0, 0.0)
    movers: float = 0.0
    body: float = 0.0
    noise_px: float = 0.4
    number: int = 300
    seed: int = 0
    slot_turn_rad: float = 0.0  # error of the rotation since one key frame alone,
    turned_slot: int = 0  # the oldest, or this one
    known_radps: float = 0.0  # at which the camera turns to the left, by the gyro
    distortion: float = 0.0  # of a lens that is taken for a pinhole: r is seen at r·(1 + distortion·r²)
    youngest: bool = False  # nothing was seen in the older half of the key frames
    body_since: int = -1  # key frame since which the body was seen, and all else since the oldest; then it moves slowly
    fit: FlowFit = field(default_factory=FlowFit)
    baselines: Baselines = field(default_factory=Baselines)
    keys: KeyFrames = field(default_factory=KeyFrames)

    def measured(self, number: int = 0, around: Situation | None = None) -> "Seen":
        """With ``number`` of the landmarks, 0: all of them."""
        number = number or self.number
        edges = EdgeTable(number, 1, 1)
        edges.append(number)
        self._look(edges, self.keys, number)
        around = around or Situation(Config(), PINHOLE)
        around.dt_s = 0.05
        lines.measure(self.baselines, self.keys, Homography(), PINHOLE, around)
        self.fit.prior_x = self.fit.prior_y = PRIOR_PX
        flow_fit.measure(self.fit, edges.columns, self.keys, self.baselines, around, SETTINGS)
        return self

    def _look(self, edges: EdgeTable, keys: KeyFrames, n: int) -> None:
        """Key frames from the oldest on, and where the edges were at each."""
        random = np.random.default_rng(self.seed)
        keys.number = KEY_FRAMES
        depth_m = random.uniform(3, 12, n)
        now = random.uniform([20, 20], [620, 460], (n, 2))
        moves = random.random(n) < (self.body or self.movers)
        if self.body:
            now[moves] = random.uniform([400, 200], [560, 360], (np.count_nonzero(moves), 2))
        rays = np.column_stack([(now - (PINHOLE.cx, PINHOLE.cy)) / PINHOLE.fx, np.ones(n)])
        own_pxps = np.where(moves[:, None], random.uniform(20, 80, (n, 2)) * random.choice([-1, 1], (n, 2)), 0)
        if self.body_since >= 0:
            own_pxps[moves] = 10.0, 0.0
        for slot in range(KEY_FRAMES):
            elapsed_s = KEY_S * (KEY_FRAMES - slot)
            way_m = SPEED_MPS * elapsed_s
            heading = np.array([*(np.array(self.focus_px) / PINHOLE.fx), 1.0])
            before = rays * depth_m[:, None] + way_m * heading
            x, y, z = (before @ self.rotation(elapsed_s)).T  # turned back
            if self.known_radps:
                turned = np.array([0.0, self.known_radps * elapsed_s, 0.0])
                np.asarray(keys.rotation)[slot] = cv2.Rodrigues(turned)[0]
                x, y, z = (np.stack([x, y, z], axis=1) @ np.asarray(keys.rotation)[slot]).T
            if slot == self.turned_slot:
                x, z = x + self.slot_turn_rad * z, z - self.slot_turn_rad * x
            then = np.stack([PINHOLE.cx + PINHOLE.fx * x / z, PINHOLE.cy + PINHOLE.fy * y / z], axis=1)
            then = self.bent(then) + random.normal(0, self.noise_px, (n, 2)) - own_pxps * elapsed_s
            edges.key_x[:n, slot], edges.key_y[:n, slot] = then.T
            keys.elapsed_s[slot] = elapsed_s
            keys.displacement[slot, 2] = way_m
        edges.x[:n], edges.y[:n] = (self.bent(now) + random.normal(0, self.noise_px, (n, 2))).T
        edges.born_key[:n] = random.integers(KEY_FRAMES // 2 if self.youngest else 0, KEY_FRAMES, n)
        if self.body_since >= 0:
            edges.born_key[:n] = np.where(moves, self.body_since, 0)
        edges.trust[:n], edges.matched[:n] = SETTINGS.tr_max, True

    def bent(self, at: Floats) -> Floats:
        """Where the lens shows what a pinhole would show there, px."""
        middle = np.array([PINHOLE.cx, PINHOLE.cy])
        r = np.hypot(*(at - middle).T)[:, None] / PINHOLE.focal
        return np.asarray(middle + (at - middle) * (1 + self.distortion * r * r))

    def rotation(self, elapsed_s: float) -> Floats:
        return np.asarray(cv2.Rodrigues(elapsed_s * np.array(self.rate_radps))[0])

    def rotation_px(self, slot: int) -> float:
        """By how much the baseline is wrong, rms px over the image."""
        turned = self.rotation(self.baselines.elapsed_s[slot])
        off = []
        for x, y in ((100.0, 100.0), (540.0, 100.0), (319.0, 240.0), (100.0, 400.0), (540.0, 400.0)):
            ray = turned @ ((x - PINHOLE.cx) / PINHOLE.fx, (y - PINHOLE.cy) / PINHOLE.fy, 1.0)
            truth = PINHOLE.cx + PINHOLE.fx * ray[0] / ray[2], PINHOLE.cy + PINHOLE.fy * ray[1] / ray[2]
            off += [lines.then_x(self.baselines, slot, x, y) - truth[0]]
            off += [lines.then_y(self.baselines, slot, x, y) - truth[1]]
        return float(np.sqrt(np.mean(np.square(off))))


def draws(movers: float, rate_radps: float, number: int = 40) -> tuple[Floats, Floats]:
    """Errors of the focus in sigmas, two a draw, and px by which the oldest baseline is wrong, over random errors."""
    sigmas, off_px = [], []
    for seed in range(number):
        random = np.random.default_rng(seed)
        rate, focus = random.uniform(-rate_radps, rate_radps, 3), random.uniform(-15, 15, 2)
        seen = Seen(tuple(rate), tuple(focus), movers=movers, seed=seed).measured()
        fit = seen.fit
        sigmas += [(fit.focus_x - focus[0]) / fit.focus_sigma_x, (fit.focus_y - focus[1]) / fit.focus_sigma_y]
        off_px.append(seen.rotation_px(0))
    return np.abs(sigmas), np.array(off_px)


def test_the_focus_is_as_far_off_as_its_sigma_says() -> None:
    """While the gyro is right within 0.005 rad/s: see the limits."""
    sigmas, off_px = draws(movers=0.0, rate_radps=0.005)
    assert np.median(sigmas) < 1.2
    assert np.quantile(sigmas, 0.9) < 3
    assert off_px.max() < 2


@pytest.mark.parametrize("rate_radps", [0.01, 0.03])
def test_an_error_of_the_rate_is_found_although_a_third_moves(rate_radps: float) -> None:
    _, off_px = draws(movers=0.33, rate_radps=rate_radps)
    assert np.median(off_px) < 1.3
    assert off_px.max() < 3.5  # of up to 10 px


@pytest.mark.parametrize("focus_px", [(12.0, 0.0), (0.0, -12.0), (-8.0, 8.0)])
def test_an_error_of_the_focus_is_found_although_a_third_moves(focus_px: tuple[float, float]) -> None:
    fits = [Seen(focus_px=focus_px, movers=0.33, seed=seed).measured().fit for seed in range(9)]
    found = np.median([(fit.focus_x, fit.focus_y) for fit in fits], axis=0)
    assert found == pytest.approx(focus_px, abs=3)


def test_the_rotation_since_every_key_frame_is_put_right() -> None:
    rate_radps = (0.02, -0.03, 0.02)
    wrong = Seen(rate_radps, number=14).measured()  # too few for a fit
    right = Seen(rate_radps).measured()
    for slot in range(KEY_FRAMES - 3):
        assert right.rotation_px(slot) < 0.2 * wrong.rotation_px(slot)


@pytest.mark.parametrize("slot", [0, 5])
def test_a_key_frame_keeps_what_the_flow_showed_of_its_rotation(slot: int) -> None:
    """Older edges, if there are any, show the same."""
    seen = Seen(slot_turn_rad=0.02, turned_slot=slot)
    seen.keys.sigma_rad[slot] = 0.02
    rotation = np.asarray(seen.measured().keys.rotation)
    assert rotation[slot, 0, 2] == pytest.approx(-0.02, abs=0.003)
    assert rotation[slot] @ rotation[slot].T == pytest.approx(np.eye(3), abs=1e-3)
    assert np.abs(np.delete(rotation, slot, axis=0) - np.eye(3)).max() < 0.005
    assert seen.keys.sigma_rad[slot] < 0.002
    seen.measured(14)  # too few for a fit: those of the last one are gone
    assert rotation[slot, 0, 2] == pytest.approx(-0.02, abs=0.003)
    assert lines.then_x(seen.baselines, slot, PINHOLE.cx, PINHOLE.cy) - PINHOLE.cx == pytest.approx(-10, abs=2)


def test_a_body_that_moves_does_not_show_the_rotation_of_the_key_frame_it_is_seen_since() -> None:
    """What is older is at rest."""
    assert Seen(body=0.2, body_since=5).measured().rotation_px(5) < 0.5


@pytest.mark.parametrize(("bias_sigma_radps", "turned_rad"), [(0.05, -0.02), (0.0, 0.0)])
def test_few_edges_show_the_rotation_of_a_key_frame_while_the_gyro_s_bias_is_unknown(
    bias_sigma_radps: float, turned_rad: float
) -> None:
    """At the start of a drive: else the far end of a street, all that is followed for long, seems to cross."""
    seen = Seen(slot_turn_rad=0.02, number=90, seed=1)
    key_frames.inflate(seen.keys, bias_sigma_radps * 0.05, 0.05)
    rotation = np.asarray(seen.measured().keys.rotation)
    assert 5 <= np.count_nonzero(np.asarray(seen.fit.slot)[: seen.fit.count] == 0) < 10
    assert rotation[0, 0, 2] == pytest.approx(turned_rad, abs=0.006)


def rotation_sigma_px(baselines: Baselines, slot: int) -> float:
    """1 sigma along the flow by the rotation since a key frame, of an edge that has not turned."""
    around, edges, error = Situation(Config(), PINHOLE), EdgeTable(1, 1, 1), MotionError()
    x, y = 500.0, 300.0
    edges.key_x[0, slot], edges.key_y[0, slot] = x, y
    error_matrix.of_rotation(error, baselines, edges.columns, 0, slot, x, y, around)
    r = math.hypot(x - PINHOLE.cx, y - PINHOLE.cy)
    return math.sqrt(error_matrix.variance(error, (x - PINHOLE.cx) / r, (y - PINHOLE.cy) / r))


def test_a_key_frame_that_the_flow_says_nothing_of_stays_as_uncertain_as_the_gyro_leaves_it() -> None:
    seen = Seen()
    seen.keys.sigma_rad[:] = 0.01
    assert rotation_sigma_px(seen.measured(14).baselines, 0) == pytest.approx(0.01 * PINHOLE.focal)
    few = Seen(youngest=True)
    few.keys.sigma_rad[:] = 0.01
    few.measured()
    assert few.baselines.is_fitted
    oldest, fitted = (rotation_sigma_px(few.baselines, slot) for slot in (0, KEY_FRAMES - 6))
    assert oldest >= 0.01 * PINHOLE.focal
    assert fitted < 0.3 * oldest


@pytest.mark.parametrize("noise_px", [0.3, 0.8])
def test_the_noise_of_corners_is_learnt_from_what_the_fit_leaves(noise_px: float) -> None:
    """Places of edges that only their corners explain, then and now: each has the noise of one."""
    around = Situation(Config(), PINHOLE)
    for seed in range(80):
        Seen(noise_px=noise_px, seed=seed).measured(around=around)
    assert math.sqrt(around.corner_var) == pytest.approx(math.sqrt(2) * noise_px, rel=0.35)


def test_a_blurred_image_is_doubted_at_once_and_a_clear_one_after_it_is_not() -> None:
    around = Situation(Config(), PINHOLE)
    for seed in range(80):
        Seen(noise_px=0.3, seed=seed).measured(around=around)
    Seen(noise_px=1.5).measured(around=around)
    assert around.excess > 9
    Seen(noise_px=0.3).measured(around=around)
    assert around.excess < 2


def test_corners_are_never_taken_to_be_better_than_whole_pixels() -> None:
    around = Situation(Config(), PINHOLE)
    for seed in range(40):
        Seen(noise_px=0.02, seed=seed).measured(around=around)
    assert math.sqrt(around.corner_var) == pytest.approx(Config().filter.corner_noise_px)


def turn_share(distortion: float, frames: int = 60) -> float:
    """What is learnt while the camera turns for three seconds."""
    fit = FlowFit()
    for seed in range(frames):
        Seen(known_radps=0.8, distortion=distortion, seed=seed, fit=fit).measured()
    return float(fit.turn_share)


def test_a_turn_is_doubted_as_much_as_the_lens_deserves() -> None:
    shares = [turn_share(distortion) for distortion in (0.0, -0.2, -0.4)]
    assert shares[0] < 0.015 < shares[1] < shares[2]
    assert shares[2] < 0.2


def test_movers_are_no_fault_of_the_lens() -> None:
    fit = FlowFit()
    for seed in range(40):
        Seen(known_radps=0.03, movers=0.8, seed=seed, fit=fit).measured()
    assert fit.turn_share < 0.1


def test_without_a_turn_nothing_is_learnt_of_it() -> None:
    before = FlowFit().turn_share
    assert Seen().measured().fit.turn_share == before


def test_what_is_right_stays_right() -> None:
    seen = Seen().measured()
    assert math.hypot(seen.fit.focus_x, seen.fit.focus_y) < 3 * max(seen.fit.focus_sigma_x, seen.fit.focus_sigma_y)
    assert all(seen.rotation_px(slot) < 0.6 for slot in range(KEY_FRAMES))


def test_the_rotation_is_fitted_with_a_covariance() -> None:
    baselines = Seen().measured().baselines
    assert baselines.is_fitted
    covariance = np.asarray(baselines.rate_covariance)
    assert covariance == pytest.approx(covariance.T)
    assert (np.linalg.eigvalsh(covariance) > 0).all()
    assert np.sqrt(np.diag(covariance)).max() < 0.01


@pytest.mark.parametrize("noise_px", [0.3, 0.6, 1.2])
@pytest.mark.parametrize("movers", [0.0, 0.2])
def test_the_scale_is_the_noise_of_two_places(noise_px: float, movers: float) -> None:
    scales = [Seen(noise_px=noise_px, movers=movers, seed=seed).measured().fit.scale_px for seed in range(5)]
    assert np.mean(scales) == pytest.approx(math.sqrt(2) * noise_px, rel=0.35)


def test_a_near_body_full_of_corners_that_moves_by_itself_is_no_noise() -> None:
    """Of 300 edges some 195 lie on it, in 6 of 48 cells."""
    scales = [Seen(noise_px=0.4, body=0.65, seed=seed).measured().fit.scale_px for seed in range(8)]
    assert np.mean(scales) < 3 * math.sqrt(2) * 0.4


def test_the_scale_grows_with_the_noise() -> None:
    scales = [Seen(noise_px=noise_px).measured().fit.scale_px for noise_px in (0.2, 0.5, 1.0, 2.0)]
    assert scales == sorted(scales)


def test_too_few_edges_are_no_fit() -> None:
    seen = Seen((0.02, 0.0, 0.0), (10.0, 0.0), number=14).measured()
    fit = seen.fit
    assert (fit.count, fit.focus_x, fit.focus_y, fit.scale_px) == (0, 0.0, 0.0, 0.0)
    assert (fit.focus_sigma_x, fit.focus_sigma_y) == (PRIOR_PX, PRIOR_PX)
    assert not seen.baselines.is_fitted


def test_of_many_edges_so_many_are_enough() -> None:
    assert 160 < Seen(number=2000).measured().fit.count <= 320


def test_less_is_sure_with_fewer_edges() -> None:
    few, many = (Seen(number=number).measured().fit for number in (40, 300))
    assert few.focus_sigma_x > many.focus_sigma_x
    assert few.focus_sigma_y > many.focus_sigma_y


@given(st.floats(0, 100), st.floats(0.1, 10))
def test_what_is_off_counts_less(rest_px: float, width_px: float) -> None:
    weight: Any = flow_fit.weight_of
    assert 0 < weight(rest_px + 0.1, width_px) < weight(rest_px, width_px) <= 1
