"""What breaks the flow of what stands still, and what does not; the chain that makes a rebel."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lcf_edge.config import Filter
from lcf_edge.filter import baselines as lines
from lcf_edge.filter import key_frames, rebel_detection
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.flow import Homography, Pinhole
from lcf_edge.filter.key_frames import KeyFrames
from lcf_edge.filter.path import least_miss, miss, way_to
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import EdgeTable

AHEAD = (0.0, 0.0, 1.0)
PINHOLE = Pinhole(500.0, 500.0, 319.5, 239.5)
SETTINGS = Settings(Filter(), PINHOLE)
STEPS = 8  # of 0.05 s
HEIGHT_M = 0.3  # of the camera
NOISE_PX = 1.1  # of the two places of an edge in a chain

Around = Callable[..., Situation]
Drive = Callable[..., Any]


class Judged:
    """Edges with the verdicts on them, a column each."""

    def __init__(self, verdicts: Verdicts) -> None:
        self.verdicts = verdicts
        for name in ("r", "drift", "short", "over", "outward", "expansion"):
            setattr(self, name, np.asarray(getattr(verdicts, name)))
        self.mover, self.incoming = (np.asarray(part) > 0 for part in (verdicts.mover, verdicts.incoming))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)


@dataclass(frozen=True)
class Watched:
    """A drive with landmarks, each seen at its start, in its middle and at its end."""

    drive: Any
    around: Situation
    rounded: bool = False

    def seen(self, *, known: bool = False) -> tuple[EdgeTable, Baselines]:
        """The edges at the end, with their key positions; and the baselines since key frames 0 (the start) and 1."""
        keys, number = KeyFrames(), len(self.drive.points_m)
        edges, baselines = EdgeTable(number, 1, 1), Baselines()
        edges.append(number)
        edges.rebel[:number] = known
        for seq, (_, motion) in enumerate(self.drive):
            if seq:
                rotation = np.ascontiguousarray(motion.rotation)[None]
                key_frames.advance(keys, rotation, *AHEAD, motion.speed_mps * motion.dt_s, motion.dt_s)
            if seq in {0, STEPS // 2}:
                slot = key_frames.mark(keys)
                edges.key_x[:number, slot], edges.key_y[:number, slot] = self.place(seq)
        edges.x[:number], edges.y[:number] = self.place(STEPS)
        lines.measure(baselines, keys, Homography(), self.around.pinhole, self.around)
        return edges, baselines

    def place(self, seq: int) -> npt.NDArray[np.float32]:
        """(2, n) px."""
        at = self.drive.in_image(seq).T
        return np.asarray(np.rint(at) if self.rounded else at, np.float32)

    def judged(self, edges: EdgeTable, baselines: Baselines, slot: int) -> Verdicts:
        verdicts = Verdicts(edges.count)
        verdicts.count = edges.count
        for row in range(edges.count):
            rebel_detection.link(verdicts, row, edges.columns, row, slot, baselines)
            rebel_detection.judge(verdicts, row, edges.columns, baselines, self.around)
        return verdicts

    def verdict(self, *, known: bool = False, sigma_px: float = 0.0) -> Judged:
        edges, baselines = self.seen(known=known)
        np.asarray(baselines.sigma_px)[:] += sigma_px
        verdicts = self.judged(edges, baselines, 0)
        rebel_detection.judge_together(verdicts, edges.columns, baselines, self.around, SETTINGS)
        return Judged(verdicts)

    def agreed(self) -> list[bool]:
        edges, baselines = self.seen()
        self.around.corner_var = NOISE_PX * NOISE_PX
        whole, recent = (self.judged(edges, baselines, slot) for slot in (0, 1))
        return [bool(rebel_detection.agree(whole, row, recent, row, baselines)) for row in range(whole.count)]


@pytest.fixture(scope="session")
def watch(drive: Drive, situation: Around) -> Callable[..., Watched]:
    def _watch(points_m: Any, velocity_mps: Any = (0, 0, 0), *, rounded: bool = False, **other: Any) -> Watched:
        speed, yaw_rate = other.pop("speed_mps", 2.0), other.pop("yaw_rate_radps", 0.0)
        way = drive(
            np.atleast_2d(np.asarray(points_m, float)),
            np.asarray(velocity_mps, float),
            frames=STEPS + 1,
            speed_mps=speed,
            yaw_rate_radps=yaw_rate,
        )
        around = situation(speed_mps=speed, yaw_rate_radps=yaw_rate, camera_height_m=HEIGHT_M, **other)
        return Watched(way, around, rounded)

    return _watch


Watch = Callable[..., Watched]


# What stands still

depth = st.floats(2.0, 40.0)
beside = st.one_of(st.floats(0.6, 8.0), st.floats(-8.0, -0.6))


@given(depth, beside, st.floats(-3.0, 0.29), st.sampled_from([0.5, 2.0, -1.0]))
def test_what_stands_beside_the_path_is_neither_mover_nor_incoming_at_any_depth(
    watch: Watch, z: float, x: float, y: float, speed_mps: float
) -> None:
    verdict = watch((x, y, z), speed_mps=speed_mps).verdict()
    assert not verdict.mover
    assert not verdict.incoming


@given(depth, beside, st.floats(-3.0, 0.29))
def test_nor_when_its_corners_are_at_whole_pixels(watch: Watch, z: float, x: float, y: float) -> None:
    assume(abs(x) > 0.06 * z)  # farther away, a pixel of flow does not distinguish beside from ahead
    verdict = watch((x, y, z), rounded=True).verdict()
    assert not verdict.mover
    assert not verdict.incoming


@given(st.floats(2.0, 6.0), beside, st.floats(-1.0, 0.25), st.sampled_from([-0.5, -0.2, 0.3, 0.6]))
def test_nor_on_an_arc(watch: Watch, z: float, x: float, y: float, yaw_rate_radps: float) -> None:
    arc_m = 2.0 / yaw_rate_radps
    off_path = abs(math.hypot(x + arc_m, z) - abs(arc_m))
    watched = watch((x, y, z), yaw_rate_radps=yaw_rate_radps)
    assume(off_path > 0.6 and watched.drive.in_camera(STEPS)[0, 2] > 0.6)
    verdict = watched.verdict()
    assert not verdict.mover
    assert not verdict.incoming


def test_an_edge_is_doubted_by_a_share_of_the_way_that_a_turn_moved_it(watch: Watch) -> None:
    watched = watch((0.5, 0.0, 4.0), yaw_rate_radps=0.4)
    edges, baselines = watched.seen()
    sure = watched.judged(edges, baselines, 0)
    watched.around.turn_share = 0.1
    doubted = watched.judged(edges, baselines, 0)
    turned_px = math.hypot(sure.x[0] - edges.key_x[0, 0], sure.y[0] - edges.key_y[0, 0])
    assert turned_px > 50
    assert doubted.sigma[0] == pytest.approx(math.hypot(sure.sigma[0], 0.1 * turned_px))


@given(st.floats(1.5, 20.0), st.floats(-2.0, 2.0))
def test_the_ground_ahead_is_no_threat(watch: Watch, z: float, x: float) -> None:
    verdict = watch((x, HEIGHT_M, z)).verdict()
    assert not verdict.mover
    assert not verdict.incoming


def test_the_expansion_of_what_stands_still_is_that_of_its_range(watch: Watch) -> None:
    watched = watch([(0.2, -0.3, 4.0), (-1.5, -0.5, 6.0), (2.0, 0.1, 9.0)])
    verdict = watched.verdict()
    _, _, z = watched.drive.in_camera(STEPS).T
    assert verdict.expansion == pytest.approx(2.0 / z, rel=1e-3)
    assert verdict.outward / verdict.r == pytest.approx(2.0 * STEPS * 0.05 / z, rel=1e-3)
    assert verdict.drift == pytest.approx(np.zeros(3), abs=1e-2)


# Incoming

WALL = [(x, y, 4.0) for x in (-0.2, 0.2) for y in (-0.9, -0.5, -0.2, 0.05)]


def test_a_wall_ahead_is_incoming(watch: Watch) -> None:
    verdict = watch(WALL).verdict()
    assert verdict.incoming.all()
    assert not verdict.mover.any()


@pytest.mark.parametrize(
    "why",
    [
        {"horizon_s": 1.0},
        {"half_width_m": 0.1},
        {"height_m": 0.2},
        {"speed_mps": -2.0},
        {"speed_mps": 0.0},
    ],
    ids=["contact is late", "the vehicle is narrow", "it is high enough above", "it drives away", "it stands"],
)
def test_a_wall_is_not_incoming_when(watch: Watch, why: dict[str, float]) -> None:
    points = [(x, y, z) for x, y, z in WALL if y < -0.15]
    assert not watch(points, **why).verdict().incoming.any()


def test_on_an_arc_what_stands_on_it_is_incoming_and_what_lies_straight_ahead_is_not(watch: Watch) -> None:
    yaw_rate_radps, turn = 0.5, 0.9  # rad, from the start to contact
    arc_m = 2.0 / yaw_rate_radps
    on_it = (-arc_m * (1 - math.cos(turn)), -0.5, arc_m * math.sin(turn))
    straight = (0.0, -0.5, arc_m * turn)
    verdict = watch([on_it, straight], yaw_rate_radps=yaw_rate_radps).verdict()
    assert verdict.incoming.tolist() == [True, False]
    assert not verdict.mover.any()


@pytest.mark.parametrize(
    ("known", "horizon_s", "lasting_yaw_radps", "is_met"),
    [(False, 3.0, 0.5, True), (False, 3.0, 0, False), (True, 3.0, 0, True), (False, 6.0, 0, True)],
    ids=["a turn", "a swerve", "a swerve at what is known", "a swerve at what is reached before it is over"],
)
def test_a_new_threat_that_is_reached_late_also_lies_near_the_arc_that_has_lasted(
    watch: Watch, known: bool, horizon_s: float, lasting_yaw_radps: float, is_met: bool
) -> None:
    arc_m, turn = 2.0 / 0.5, 0.9  # rad, from the start to contact
    on_it = (-arc_m * (1 - math.cos(turn)), -0.5, arc_m * math.sin(turn))
    swerving = watch([on_it], yaw_rate_radps=0.5, lasting_yaw_radps=lasting_yaw_radps, horizon_s=horizon_s)
    assert swerving.verdict(known=known).incoming.tolist() == [is_met]


@pytest.mark.parametrize("yaw_rate_radps", [0.5, -0.5])
def test_the_miss_is_the_distance_from_the_arc_to_the_right(situation: Around, yaw_rate_radps: float) -> None:
    around = situation(speed_mps=2.0, yaw_rate_radps=yaw_rate_radps)
    arc_m, turn = 2.0 / yaw_rate_radps, 0.7
    for off in (-0.8, 0.0, 0.8):  # right of the path
        radius = arc_m + off
        right, ahead = radius * math.cos(turn) - arc_m, abs(radius) * math.sin(turn)
        assert miss(right, ahead, around) == pytest.approx(off, abs=1e-9)


def test_the_miss_of_a_straight_drive_is_the_offset(situation: Around) -> None:
    for around in (situation(), situation(speed_mps=math.nan), situation(speed_mps=0.0)):
        assert (miss(-2.0, 3.0, around), miss(0.5, 9.0, around)) == (-2.0, 0.5)


def test_a_turn_at_an_unknown_speed_is_one_at_the_assumed_speed(situation: Around) -> None:
    unknown = situation(speed_mps=math.nan, yaw_rate_radps=1.0)
    known = situation(speed_mps=unknown.assumed_mps, yaw_rate_radps=1.0)
    assert unknown.assumed_mps == 4 * 2 * unknown.half_width_m
    assert miss(-2.0, 3.0, unknown) == miss(-2.0, 3.0, known)


@pytest.mark.parametrize("yaw_rate_radps", [0.5, -0.5])
def test_a_camera_before_the_axle_sees_the_arc_of_the_axle(situation: Around, yaw_rate_radps: float) -> None:
    """The camera itself is swung out of the arc, by what its distance from the centre is more."""
    around = situation(speed_mps=1.0, yaw_rate_radps=yaw_rate_radps, lever_m=0.5)
    out_m = math.hypot(2.0, 0.5) - 2.0
    assert miss(0.0, 0.0, around) == pytest.approx(math.copysign(out_m, yaw_rate_radps))
    assert way_to(0.0, 0.0, around) == pytest.approx(0.0)
    arc_m, turn = 1.0 / yaw_rate_radps, 0.7
    right, ahead = arc_m * math.cos(turn) - arc_m, abs(arc_m) * math.sin(turn) - 0.5
    assert miss(right, ahead, around) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("yaw_rate_radps", [0.5, -0.5, 0.0])
def test_the_way_to_a_point_is_as_long_as_the_arc_that_ends_beside_it(situation: Around, yaw_rate_radps: float) -> None:
    around = situation(speed_mps=2.0, yaw_rate_radps=yaw_rate_radps)
    for off in (-0.8, 0.0, 0.8):
        right, ahead = off, 2.8
        if yaw_rate_radps:
            arc_m, turn = 2.0 / yaw_rate_radps, 0.7  # 2.8 m on the arc
            right, ahead = (arc_m + off) * math.cos(turn) - arc_m, abs(arc_m + off) * math.sin(turn)
        assert way_to(right, ahead, around) == pytest.approx(2.8, abs=1e-9)


@pytest.mark.parametrize(
    ("yaw_rate_radps", "right_m", "least_m"),
    [
        pytest.param(0.1, -0.2, 0.0, id="between the straight line and the arc"),
        pytest.param(0.1, 0.3, 0.3, id="on the other side: of the straight line"),
        pytest.param(0.1, -0.7, None, id="beyond the arc: of the arc"),
        pytest.param(0.5, -0.2, None, id="a turn that is not small comes: of the arc"),
    ],
)
def test_a_small_turn_may_as_well_not_come(
    situation: Around, yaw_rate_radps: float, right_m: float, least_m: float | None
) -> None:
    """At 1 m/s to the left, 3 m ahead: 0.3 rad and 1.5 rad."""
    around = situation(speed_mps=1.0, yaw_rate_radps=yaw_rate_radps)
    arc_m = miss(right_m, 3.0, around)
    assert arc_m != pytest.approx(right_m, abs=0.1)
    assert least_miss(right_m, 3.0, around) == pytest.approx(arc_m if least_m is None else least_m)


@pytest.mark.parametrize(("yaw_rate_radps", "least_m"), [(0.12, 0.0), (0.15, None)])
def test_a_slight_turn_may_be_over_long_before_what_is_far_ahead(
    situation: Around, yaw_rate_radps: float, least_m: float | None
) -> None:
    """At 1 m/s, 6 m ahead: the arc turns by 0.7 and 0.9 rad until there, in the next 3 s by 0.36 and 0.45 rad."""
    around = situation(speed_mps=1.0, yaw_rate_radps=yaw_rate_radps)
    arc_m = miss(-0.5, 6.0, around)
    assert arc_m > 1.0
    assert least_miss(-0.5, 6.0, around) == pytest.approx(arc_m if least_m is None else least_m)


def test_neighbours_show_together_what_one_edge_near_the_focus_cannot(watch: Watch) -> None:
    """10 px from the focus an edge moves by a pixel or so; a dozen of them leave no doubt."""
    few = [(0.06, -0.08, 6.5)]
    many = [(x, y, 6.5) for x in (-0.08, 0.0, 0.08) for y in (-0.16, -0.12, -0.08, -0.04)]
    corner_var = 0.3  # px²
    assert not watch(few, corner_var=corner_var).verdict().incoming.any()
    assert watch(many, corner_var=corner_var).verdict().incoming.sum() >= 9


def test_a_threat_begins_a_little_inside_the_horizon_and_ends_at_it(watch: Watch) -> None:
    wall = [(x, y, 4.75) for x in (-0.2, 0.2) for y in (-0.9, -0.5, -0.2)]  # 1.98 s from contact at the end
    assert not watch(wall, horizon_s=2.0).verdict().incoming.any()
    assert watch(wall, horizon_s=2.0).verdict(known=True).incoming.all()


@pytest.mark.parametrize(("horizon_sigma_rad", "is_met"), [(0.002, True), (0.05, False)])
def test_what_may_as_well_be_the_ground_is_not_met(watch: Watch, horizon_sigma_rad: float, is_met: bool) -> None:
    """A box 15 cm high, 6 m ahead: where the horizon is not known well, the ground may lie as high."""
    low = [(x, y, 6.0) for x in (-0.1, 0.0, 0.1) for y in (0.15, 0.18, 0.21)]
    seen = watch(low, horizon_sigma_rad=horizon_sigma_rad).verdict()
    assert seen.incoming.all() if is_met else not seen.incoming.any()


def box_ahead(z: float, top: float, foot: float) -> list[tuple[float, float, float]]:
    """Corners of something upright on the path, from ``top`` down to its ``foot``; y down from the camera, m."""
    return [(x, float(y), z) for x in (-0.15, 0.0, 0.15) for y in np.linspace(top, foot, 6)]


def test_a_small_box_is_told_from_the_ground_by_its_upright_shape(watch: Watch) -> None:
    """Its foot moves as the ground does there; higher up the ground would lie far behind it."""
    box = box_ahead(6.0, 0.0, 0.28)
    verdict = watch(box, corner_var=0.1).verdict()
    above = np.array([y for _, y, _ in box]) < 0.2
    assert verdict.incoming[above].all()


def off_a_little(watch: Watch, edges: int) -> Watched:
    """Something 20 m ahead that has moved a little to the side; each edge shows it by a few sigmas."""
    board = [(0.1 * (k % 4) - 0.15, -1.5 - 0.2 * (k // 4), 20.0) for k in range(edges)]
    watched = watch(board, (0.2, 0.0, 0.0), corner_var=0.3)
    verdicts = watched.judged(*watched.seen(), 0)
    sigmas = np.abs(verdicts.drift) / np.asarray(verdicts.across)
    assert ((sigmas > 1.5) & (sigmas < 4.0)).all()
    return watched


@pytest.mark.parametrize(("edges", "moves"), [(1, False), (8, True)])
def test_what_moves_too_little_for_one_edge_to_show_it_is_shown_by_several(
    watch: Watch, edges: int, moves: bool
) -> None:
    assert (off_a_little(watch, edges).verdict().mover == moves).all()


@pytest.mark.parametrize(("edges", "moves"), [(1, False), (8, True)])
def test_what_leads_too_far_ahead_for_one_edge_to_show_it_is_shown_by_several(
    watch: Watch, edges: int, moves: bool
) -> None:
    """It keeps station low above the ground, which would flow outward."""
    board = [(0.5 + 0.04 * (k % 4), 0.22 - 0.03 * (k // 4), 4.0) for k in range(edges)]
    watched = watch(board, (0.0, 0.0, 2.0), corner_var=2.4)
    verdicts = watched.judged(*watched.seen(), 0)
    sigmas = np.asarray(verdicts.short) / np.hypot(verdicts.sigma, verdicts.noise)
    assert ((sigmas > 1.5) & (sigmas < 4.0)).all()
    assert (watched.verdict().mover == moves).all()


def test_few_edges_that_happen_to_be_off_alike_are_no_movers(watch: Watch) -> None:
    assert not off_a_little(watch, 3).verdict().mover.any()


def test_neighbours_that_are_off_to_both_sides_do_not_move_together(watch: Watch) -> None:
    watched = off_a_little(watch, 6)
    edges, baselines = watched.seen()
    then_x = np.asarray(watched.judged(edges, baselines, 0).x)
    edges.x[:6:2] -= 2 * (edges.x[:6:2] - then_x[::2])
    verdicts = watched.judged(edges, baselines, 0)
    rebel_detection.judge_together(verdicts, edges.columns, baselines, watched.around, SETTINGS)
    assert not np.asarray(verdicts.mover).any()


def test_what_the_rotation_may_have_shifted_alike_does_not_move_together(watch: Watch) -> None:
    """However many edges: its uncertainty does not average out."""
    assert not off_a_little(watch, 8).verdict(sigma_px=1.0).mover.any()


@given(st.floats(1.2, 6.0), st.floats(-0.4, 0.4), st.floats(0.85, 1.15))
def test_the_ground_is_not_taken_for_something_upright_even_if_misjudged(
    watch: Watch, z: float, x: float, deeper: float
) -> None:
    """By less than ``filter.ground_margin``: a patch of it is flat, however exactly its range is known."""
    height_m = HEIGHT_M * deeper
    patch = [(x + across, height_m, z + ahead) for across in (-0.1, 0.0, 0.1) for ahead in (0.0, 0.1, 0.2, 0.3)]
    assert not watch(patch, corner_var=0.01, horizon_sigma_rad=0.002).verdict().incoming.any()


def test_what_a_wrong_rotation_shifts_alike_does_not_seem_near(watch: Watch) -> None:
    """Far away and high up, everything shifts outwards by two sigmas of the rotation."""
    far = [(x, y, 40.0) for x in (-0.5, 0.0, 0.5) for y in (-7.0, -6.6, -6.2)]
    watched = watch(far, corner_var=0.1, height_m=20.0, horizon_s=8.0, half_width_m=2.0)
    edges, baselines = watched.seen()
    np.asarray(baselines.sigma_px)[:] = 2.0
    edges.y[:] -= 4.0
    verdicts = watched.judged(edges, baselines, 0)
    rebel_detection.judge_together(verdicts, edges.columns, baselines, watched.around, SETTINGS)
    assert not np.asarray(verdicts.incoming).any()


def test_an_edge_that_contradicts_its_neighbours_is_not_met_with_them(watch: Watch) -> None:
    """One corner of what stands 3 m behind a wall, where it shows its range better than each of them."""
    wall = [(x, y, 6.0) for x in (-0.09, -0.03, 0.03, 0.09) for y in (-0.2, -0.15, -0.1)]
    verdict = watch([*wall, (0.0, -0.525, 9.0)], corner_var=0.1).verdict()
    assert verdict.incoming[:-1].all()
    assert not verdict.incoming[-1]


def test_edges_of_the_ground_that_happen_to_agree_do_not_make_it_upright(watch: Watch) -> None:
    """On small tiles corners seem to move by whole tiles, so that some show one range, over several rows."""
    tile_px, number, rng = 3.0, 100, np.random.default_rng(1)
    across, ahead = rng.uniform(-0.2, 0.2, number), rng.uniform(1.8, 2.8, number)
    watched = watch(np.stack([across, np.full(number, 0.28), ahead], axis=1), horizon_sigma_rad=0.002, corner_var=0.04)
    edges, baselines = watched.seen()
    then_y = np.asarray(watched.judged(edges, baselines, 0).y)
    edges.y[:number] = then_y + tile_px * np.round((edges.y[:number] - then_y) / tile_px)
    verdicts = watched.judged(edges, baselines, 0)
    rebel_detection.judge_together(verdicts, edges.columns, baselines, watched.around, SETTINGS)
    assert not np.asarray(verdicts.incoming).any()


@pytest.mark.parametrize(("edges", "are_met"), [(1, False), (6, True)])
def test_the_fewer_edges_the_surer_they_must_be(watch: Watch, edges: int, are_met: bool) -> None:
    watched = watch([(0.02 * k - 0.05, -0.35, 6.0) for k in range(edges)], corner_var=0.6)
    verdicts = watched.judged(*watched.seen(), 0)
    sigmas = verdicts.outward[0] / math.hypot(verdicts.sigma[0], verdicts.astray[0], verdicts.noise[0])
    assert 5.0 < sigmas < 7.0  # of each
    assert bool(watched.verdict().incoming.all()) is are_met


def test_edges_that_scatter_more_than_their_noise_are_believed_less(watch: Watch) -> None:
    """Sideways, where it does not change the range that each shows."""
    watched = watch([(x, y, 6.0) for x in (-0.1, 0.0, 0.1) for y in (-0.35, -0.25)], corner_var=0.4)
    edges, baselines = watched.seen()
    verdicts = watched.judged(edges, baselines, 0)
    rebel_detection.judge_together(verdicts, edges.columns, baselines, watched.around, SETTINGS)
    assert np.asarray(verdicts.incoming).all()
    edges.x[: edges.count] += [3.0, -3.0, -3.0, 3.0, 3.0, -3.0]
    verdicts = watched.judged(edges, baselines, 0)
    rebel_detection.judge_together(verdicts, edges.columns, baselines, watched.around, SETTINGS)
    assert not np.asarray(verdicts.mover).any()
    assert not np.asarray(verdicts.incoming).any()


# Movers


@given(st.floats(3.0, 4.0), st.floats(-0.4, 0.4), st.floats(-1.6, -1.0), st.sampled_from([-1.2, -0.9, 0.9, 1.2]))
def test_what_crosses_moves(watch: Watch, z: float, x: float, y: float, velocity_mps: float) -> None:
    """High up, where aside is across the flow: along it one camera cannot distinguish a motion from another depth."""
    verdict = watch((x, y, z), (velocity_mps, 0, 0)).verdict()
    assert verdict.mover
    assert not verdict.incoming


def test_what_crosses_right_before_us_moves(watch: Watch) -> None:
    """Nothing that stands still leaves the focus so fast."""
    velocities = [(-1.2, 0, 0), (1.2, 0, 0), (0, -1.2, 0), (1.2, 0.6, 0)]
    near_the_focus = [(off_m, 0.5 * off_m, 3.0) for off_m in (0.005, 0.01, 0.03, 0.1)]
    points = [point for point in near_the_focus for _ in velocities]
    assert watch(points, velocities * len(near_the_focus)).verdict().mover.all()


def test_what_crosses_drifts_to_the_side_it_goes_to(watch: Watch) -> None:
    high_up = [(0.0, -0.8, 4.0)] * 2
    right, left = watch(high_up, [(1, 0, 0), (-1, 0, 0)]).verdict().drift
    assert right == pytest.approx(-left)
    assert abs(right) == pytest.approx(0.4 * 500 / 3.2, rel=0.01)


def test_what_leads_keeps_station_where_the_ground_would_flow(watch: Watch) -> None:
    near_the_ground = [(x, 0.25, 2.0) for x in (-0.2, 0.0, 0.2)]
    verdict = watch(near_the_ground, (0, 0, 2.0)).verdict()
    assert verdict.mover.all()
    assert (verdict.short > np.abs(verdict.drift)).all()
    assert not verdict.incoming.any()
    assert not watch(near_the_ground).verdict().mover.any()


def test_what_comes_towards_us_on_the_path_is_incoming_as_a_nearer_wall_would_be(watch: Watch) -> None:
    oncoming = [(x, y, 6.0) for x in (-0.15, 0.15) for y in (-0.9, -0.6)]
    verdict = watch(oncoming, (0, 0, -1.5)).verdict()
    assert verdict.incoming.all()
    assert verdict.expansion == pytest.approx(3.5 / (6.0 - 3.5 * 0.4), rel=1e-3)


def test_faster_than_anything_that_stands_still_can_go_out_is_a_mover(watch: Watch) -> None:
    """Nothing stands nearer than the nearest depth."""
    verdict = watch((0.4, -0.4, 6.0), (0, 0, -12.0), speed_mps=0.2).verdict()
    assert verdict.mover
    assert verdict.over > 0


def test_uncertain_rotation_and_noise_widen_the_error_span(watch: Watch) -> None:
    watched = watch((0.0, -0.8, 4.0), (0.25, 0, 0))
    assert watched.verdict().mover
    assert not watched.verdict(sigma_px=30.0).mover


# Chains


def test_a_steady_crossing_agrees_with_itself(watch: Watch) -> None:
    assert watch([(0, -0.8, 4.0), (0.5, -0.5, 5.0)], (1.0, 0, 0)).agreed() == [True, True]


def test_a_wall_ahead_agrees_with_itself(watch: Watch) -> None:
    assert all(watch(WALL).agreed())
    assert all(watch(WALL, rounded=True).agreed())


def verdict_of(*, mover: bool, drift: float = 0.0, expansion: float = 0.0, slot: int = 0) -> Verdicts:
    """A verdict on one edge 100 px from the focus."""
    verdicts = Verdicts(1)
    verdicts.count = 1
    columns = {"r": 100.0, "noise": NOISE_PX, "drift": drift, "short": -50.0, "over": -50.0, "expansion": expansion}
    for name, value in (columns | {"slot": slot, "mover": mover, "incoming": not mover}).items():
        np.asarray(getattr(verdicts, name))[0] = value
    return verdicts


def agrees(whole: Verdicts, recent: Verdicts) -> bool:
    """A chain of 0.4 s of which the recent link took 0.2 s."""
    baselines = Baselines()
    np.asarray(baselines.elapsed_s)[:2] = 0.4, 0.2
    np.asarray(recent.slot)[0] = 1
    return bool(rebel_detection.agree(whole, 0, recent, 0, baselines))


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_jump_is_no_motion(sign: int) -> None:
    assert agrees(verdict_of(mover=True, drift=sign * 60), verdict_of(mover=True, drift=sign * 30))
    assert not agrees(
        verdict_of(mover=True, drift=sign * 60), verdict_of(mover=True, drift=sign * 60)
    )  # all of it in the recent link
    assert not agrees(verdict_of(mover=True, drift=sign * 60), verdict_of(mover=False))  # all of it before
    assert not agrees(verdict_of(mover=True, drift=sign * 60), verdict_of(mover=True, drift=sign * -30))


def test_an_expansion_that_jumps_comes_from_no_wall() -> None:
    assert agrees(verdict_of(mover=False, expansion=0.5), verdict_of(mover=False, expansion=0.5))
    assert not agrees(verdict_of(mover=False, expansion=0.5), verdict_of(mover=False, expansion=1.5))
    assert not agrees(verdict_of(mover=False, expansion=0.5), verdict_of(mover=False, expansion=0.0))


def born(*l123: tuple[float, float]) -> EdgeTable:
    """E_r from key positions L1, L2, L3, the last two 0.1 s apart."""
    edges, first, second = EdgeTable(4, 2, 2), Verdicts(1), Verdicts(1)
    edges.append(1)
    edges.x[0], edges.y[0], edges.suspect_keys[0] = *l123[2], 2
    for verdicts, (x, y) in zip((first, second), l123[:2], strict=True):
        np.asarray(verdicts.x)[0], np.asarray(verdicts.y)[0] = x, y
    rebel_detection.give_birth(edges.columns, first, 0, second, 0, 0.1, SETTINGS)
    return edges


def test_a_rebel_is_born_with_the_papers_numbers() -> None:
    """L1 = (10, 10), L2 = (20, 10), L3 = (30, 14)."""
    edges = born((10, 10), (20, 10), (30, 14))
    beta = math.atan2(4, 20)
    assert edges.rebel[0]
    assert edges.suspect_keys[0] == 0
    assert edges.beta[0] == pytest.approx(beta)  # ∠(L3 - L1)
    assert edges.deviation[0] == pytest.approx(beta - 0.0)  # ∠(L3 - L1) - ∠(L2 - L1)
    assert edges.speed[0] == pytest.approx(math.hypot(10, 4) / 0.1)  # |L3 - L2| / t
    assert (edges.origin_x[0], edges.origin_y[0]) == (10, 10)  # L1


@pytest.mark.parametrize("quarter", range(4))
def test_birth_does_not_depend_on_the_direction(quarter: int) -> None:
    turn = np.round([[math.cos(a), -math.sin(a)] for a in (quarter * math.pi / 2,)])[0]
    places = [(x * turn[0] + y * turn[1], -x * turn[1] + y * turn[0]) for x, y in ((-10, -2), (-20, 1), (-30, -1))]
    edges, upright = born(*places), born((-10, -2), (-20, 1), (-30, -1))
    assert edges.deviation[0] == pytest.approx(upright.deviation[0], abs=1e-5)
    assert edges.speed[0] == pytest.approx(upright.speed[0], rel=1e-5)
    assert -math.pi < edges.deviation[0] <= math.pi


def test_a_first_link_too_short_for_a_direction_has_no_deviation() -> None:
    assert born((10, 10), (10.5, 9), (30, 14)).deviation[0] == 0
