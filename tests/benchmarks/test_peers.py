"""What the peers share, against flow fields with exact answers; and that each peer runs on anything."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.peers import PEERS, LandmarkMap
from benchmarks.peers.backdrop import Backdrop
from benchmarks.peers.clustering import TrustedCircles, cluster
from benchmarks.peers.ego import SLOTS, Ego
from benchmarks.peers.orb import _nearest
from benchmarks.peers.residual import Residual, Tracks, residual
from benchmarks.playing import config_of, play_drive
from lcf_edge.config import Camera, Config, Vehicle
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens
from lcf_edge.messages import CIRCLE, Cause
from lcf_edge.rendered import scenes

LENS = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
CONFIG = Config(camera=Camera(height_m=0.5), vehicle=Vehicle(half_width_m=0.6, horizon_s=4.0))
DT_S = 0.05
SPEED_MPS = 2.0


def turn(x_rad: float, y_rad: float, z_rad: float) -> np.ndarray:
    """A small rotation of directions."""
    return cv2.Rodrigues(np.array([x_rad, y_rad, z_rad]))[0]


def driven(frames: int, *, speed_mps: float = SPEED_MPS, yaw_rate_radps: float = 0.0) -> Ego:
    """An ego that remembered its first frame and drove on; a left turn moves what is seen to the right."""
    ego = Ego(CONFIG, LENS)
    ego.remember()
    rotation = turn(0.0, yaw_rate_radps * DT_S, 0.0)
    for _ in range(frames):
        ego.advance(Motion(DT_S, rotation, 0.0, speed_mps, yaw_rate_radps))
    return ego


def project(points_m: np.ndarray) -> np.ndarray:
    """Camera axes (n, 3) to px (n, 2)."""
    return (points_m[:, :2] / points_m[:, 2:] * 500.0 + (319.5, 239.5)).astype(np.float32)


def seen(ego: Ego, before_m: np.ndarray, moved_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Tracks:
    """Tracks since slot 0 of points (n, 3) that were at ``before_m`` and have moved by themselves since."""
    now_m = before_m @ ego.rotation[0].T - ego.way_m[0] + moved_m
    then, now = project(before_m), project(now_m)
    slot = np.zeros(len(before_m), np.intp)
    x, y = ego.derotate(slot, then[:, 0], then[:, 1])
    return Tracks(slot, x, y, now[:, 0], now[:, 1])


def wall(x_m: float, z_m: float, half_m: float = 0.2, side: int = 5) -> np.ndarray:
    """A square patch that stands upright above the camera's height."""
    across, up = np.meshgrid(np.linspace(-half_m, half_m, side), np.linspace(-2 * half_m, half_m, side))
    return np.stack([x_m + across.ravel(), up.ravel(), np.full(side * side, z_m)], axis=1)


def judge(ego: Ego, tracks: Tracks) -> Residual:
    return residual(tracks, ego, CONFIG, noise_px=0.3, mover_px=2.0)


def test_what_stands_beside_the_path_breaks_nothing() -> None:
    ego = driven(8)
    points = judge(ego, seen(ego, np.concatenate([wall(2.0, 6.0), wall(-3.0, 9.0), wall(1.5, 20.0)])))
    assert not points.mover.any()
    assert not points.threat.any()


def test_what_stands_ahead_is_a_threat_with_its_time_to_contact() -> None:
    ego = driven(8)
    z_m = 6.0
    points = judge(ego, seen(ego, wall(0.1, z_m)))
    assert points.threat.mean() > 0.8
    assert not points.mover.any()
    left_s = (z_m - 8 * DT_S * SPEED_MPS) / SPEED_MPS
    assert points.ttc_s[points.threat] == pytest.approx(left_s, rel=0.01)
    assert points.lateral_m[points.threat] == pytest.approx(wall(0.1, z_m)[points.threat, 0], abs=0.01)


def test_contact_beyond_the_horizon_is_none_yet() -> None:
    ego = driven(8)
    assert not judge(ego, seen(ego, wall(0.0, 10.0))).threat.any()


def test_the_road_ahead_is_no_threat() -> None:
    ego = driven(8)
    road = np.stack(np.meshgrid([-0.4, 0.0, 0.4], [0.5], [2.0, 3.0, 4.0, 6.0]), axis=-1).reshape(-1, 3)
    points = judge(ego, seen(ego, road))
    assert not points.threat.any()
    assert not points.mover.any()


@pytest.mark.parametrize(
    ("x_m", "moved_m"),
    [(-1.5, (0.4, 0.0, 0.0)), (1.5, (-0.4, 0.0, 0.0)), (1.5, (0.0, 0.0, 0.8))],
    ids=["in from the left", "in from the right", "ahead"],
)
def test_what_moves_leaves_the_flow(x_m: float, moved_m: tuple[float, float, float]) -> None:
    ego = driven(8)
    body = wall(x_m, 6.0)
    body[:, 1] += 0.35  # reaches down to where the ground behind it tells its range
    points = judge(ego, seen(ego, body, moved_m))
    assert points.mover.mean() > 0.4


def test_on_a_turn_the_path_is_an_arc() -> None:
    """On an arc to the left, what stands straight ahead is passed on the right, and what lies on the arc is met."""
    yaw_rate = 0.5
    ego = driven(8, yaw_rate_radps=yaw_rate)
    radius, ahead = SPEED_MPS / yaw_rate, 3.0
    on_arc = -(radius - math.sqrt(radius**2 - ahead**2))
    now = np.concatenate([wall(0.0, ahead), wall(on_arc, ahead)])
    before = (now + ego.way_m[0]) @ ego.rotation[0]
    points = judge(ego, seen(ego, before))
    assert points.lateral_m[:25].mean() > 0.8
    assert abs(points.lateral_m[25:].mean()) < 0.3


def test_a_gyro_that_is_off_is_found_out() -> None:
    ego = driven(8)
    around = np.concatenate([wall(x, z, 0.5) for x in (-4.0, -2.5, 2.5, 4.0) for z in (5.0, 8.0, 12.0)])
    tracks = seen(ego, around)
    missed = turn(0.004, -0.003, 0.002)  # over the 0.4 s of the track
    x, y = (tracks.x - 319.5) / 500, (tracks.y - 239.5) / 500
    shifted = project(np.stack([x, y, np.ones_like(x)], axis=1) @ missed.T)
    points = judge(ego, Tracks(tracks.slot, tracks.x_then, tracks.y_then, shifted[:, 0], shifted[:, 1]))
    assert not points.mover.any()


@given(
    angles=st.tuples(*[st.floats(-0.02, 0.02)] * 3),
    speed_mps=st.floats(-2.0, 4.0),
    frames=st.integers(1, 8),
    point=st.tuples(st.floats(-3, 3), st.floats(-1, 1), st.floats(8, 30)),
)
def test_the_focus_and_the_turn_explain_what_stands_still(
    angles: tuple[float, float, float], speed_mps: float, frames: int, point: tuple[float, float, float]
) -> None:
    """After derotation a point that stands still has moved on the line through the focus, and no other way."""
    ego = Ego(CONFIG, LENS)
    ego.remember()
    for _ in range(frames):
        ego.advance(Motion(DT_S, turn(*angles), 0.0, speed_mps, 0.0))
    tracks = seen(ego, np.array([point]))
    focus_x, focus_y, ahead_m = ego.focus_since(tracks.slot)
    if abs(ahead_m[0]) < 0.02:
        return
    out = np.array([tracks.x_then - focus_x, tracks.y_then - focus_y]).ravel()
    move = np.array([tracks.x - tracks.x_then, tracks.y - tracks.y_then]).ravel()
    off = abs(out[0] * move[1] - out[1] * move[0]) / max(float(np.hypot(*out)), 1.0)
    assert off < 0.05


def test_the_slots_go_round() -> None:
    ego = Ego(CONFIG, LENS)
    assert ego.slot_back(4) is None
    slots = [ego.remember() for _ in range(SLOTS + 2)]
    assert slots == [*range(SLOTS), 0, 1]
    assert ego.slot_back(1) == 1
    assert ego.slot_back(4) == SLOTS - 2
    assert ego.slot_back(99) == 2  # the oldest


def test_the_backdrop_moves_as_the_ground_does() -> None:
    ego = driven(4)
    ground = np.array([[-0.5, 0.5, 3.0], [0.4, 0.5, 4.0], [1.0, 0.5, 6.0]])
    tracks = seen(ego, ground)
    expected = Backdrop(CONFIG, ego, 2).expect(np.stack([tracks.x, tracks.y], axis=1), 0)
    np.testing.assert_allclose(expected, np.stack([tracks.x_then, tracks.y_then], axis=1), atol=0.05)
    sky = np.array([[100.0, 50.0]], np.float32)
    np.testing.assert_array_equal(Backdrop(CONFIG, ego, 2).expect(sky, 0), sky)


def points_at(x: np.ndarray, y: np.ndarray, vx: np.ndarray, mover: bool) -> Residual:
    still, far = np.zeros_like(x), np.full_like(x, 5.0)
    flags = np.full(len(x), mover)
    return Residual(x, y, vx, still, y - 239.5, flags, ~flags, np.full_like(x, 2.0), far, still)


def test_points_that_go_together_are_one_cluster() -> None:
    x, y = (np.tile(each, 3).astype(np.float32) for each in ([0, 12, 24, 12], [0, 12, 24, 0]))
    x += np.repeat(np.float32([100, 110, 400]), 4)
    y += 200
    vx = np.repeat(np.float32([200, -200, 0]), 4)  # two that pass each other, and one far away
    found = cluster(points_at(x, y, vx, mover=True), least=4, link_px=30.0, share=0.2)
    assert sorted(found.vx.tolist()) == [-200, 0, 200]
    assert found.support.tolist() == [4, 4, 4]
    assert len(cluster(points_at(x[:3], y[:3], vx[:3], mover=True), least=4, link_px=30.0, share=0.2)) == 0


def test_a_circle_is_shown_when_it_was_found_twice_and_stays_for_a_while() -> None:
    ego = driven(1)
    x, y = np.float32([300, 312, 324, 312]), np.float32([200, 212, 224, 200])
    found = cluster(points_at(x, y, np.zeros(4, np.float32), mover=False), least=4, link_px=30.0, share=0.2)
    nothing = cluster(points_at(*np.zeros((3, 0), np.float32), mover=False), least=4, link_px=30.0, share=0.2)
    circles = TrustedCircles()
    assert len(circles.update(found, ego)) == 0
    (circle,) = circles.update(found, ego)
    assert circle["trust"] >= 3
    assert circle["ttc"] == pytest.approx(2.0, abs=0.1)
    assert circle["cause"] == Cause.INCOMING
    assert len(circles.update(nothing, ego)) == 1
    assert [len(circles.update(nothing, ego)) for _ in range(4)][-1] == 0


def test_the_most_alike_descriptor_within_reach() -> None:
    random = np.random.default_rng(0)
    points = random.uniform(0, 640, (60, 2)).astype(np.float32)
    looks = random.integers(0, 256, (60, 32)).astype(np.uint8)
    order = random.permutation(60)
    np.testing.assert_array_equal(_nearest(points, looks, points[order], looks[order]), np.argsort(order))
    away = points + np.float32(1000)
    assert (_nearest(points, looks, away, looks) == -1).all()


DRIVE = scenes.make("ahead", 0, seconds=0.7, width=320, height=240, focal_px=250.0)


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_says_the_same_of_the_same_drive(name: str) -> None:
    said = []
    for _ in range(2):
        moments = list(play_drive(DRIVE, config_of(DRIVE), [name]))
        said.append([moment.scenes[name].circles.tobytes() for moment in moments])
        assert all(moment.scenes[name].circles.dtype == CIRCLE for moment in moments)
    assert said[0] == said[1]


@pytest.mark.parametrize("peer", [*PEERS.values(), LandmarkMap])
@pytest.mark.parametrize("speed_mps", [2.0, 0.0, -1.0, math.nan])
def test_a_picture_without_anything_gives_nothing(peer: type, speed_mps: float) -> None:
    method = peer(CONFIG, LENS)
    for _ in range(12):
        motion = Motion(DT_S, np.eye(3), 0.001, speed_mps, 0.0)
        assert len(method.process(np.full((480, 640), 90, np.uint8), motion)) == 0


def test_the_map_only_grows() -> None:
    config = config_of(DRIVE)
    sizes = [moment.scenes["landmark_map"].sizes.edges_normal for moment in play_drive(DRIVE, config, ["landmark_map"])]
    assert sizes[0] > 0
    assert sizes == sorted(sizes)
    assert sizes[-1] > sizes[0]
