"""What crosses and comes near is followed although it accelerates in the image; blur does not end what it hides."""

import numpy as np
import pytest

from lcf_edge.config import Config, Filter
from lcf_edge.filter import edge_expert
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import CircleTable, CornerTable, EdgeTable, GroupTable
from lcf_edge.messages import Cause

PINHOLE = Pinhole(500.0, 500.0, 319.5, 239.5)
SETTINGS = Settings(Filter(), PINHOLE)
DT_S = 0.05
DELTA_PX = SETTINGS.delta_px
TR_MAX = SETTINGS.tr_max


def left_behind(step_px: float, behind_px: float, aside_px: float = 0.0, cause: Cause = Cause.CROSSING) -> float:
    """How far L stays from its corner, px: of a trusted rebel that moves ``step_px`` a frame to the right.

    Its corner is found ``behind_px`` farther on than predicted, and ``aside_px`` to the side.
    """
    edges, normal, rebel, corners = EdgeTable(4, 2, 2), CircleTable(2), CircleTable(2), CornerTable(4)
    row = edges.append(1).start
    edges.x[row] = edges.predicted_x[row] = 300.0
    edges.y[row] = edges.predicted_y[row] = 200.0
    edges.cos[row], edges.sin[row], edges.predicted_speed[row] = 1.0, 0.0, step_px / DT_S
    edges.rebel[row], edges.trust[row], edges.circle[row], edges.corner[row] = True, TR_MAX, 0, 0
    edges.bl[row] = 12.0
    rebel.cause[0], rebel.active[0] = cause, True
    corners.x[0], corners.y[0] = 300.0 + behind_px, 200.0 + aside_px
    around = Situation(Config(), PINHOLE)
    around.dt_s = DT_S
    edge_expert.update(edges.columns, normal.columns, rebel.columns, corners.columns, 0.0, around, SETTINGS)
    return float(np.hypot(corners.x[0] - edges.x[row], corners.y[0] - edges.y[row]))


@pytest.mark.parametrize("behind_px", [4.0, 8.0, 20.0])
def test_what_crosses_fast_and_goes_on_faster_is_not_left_behind(behind_px: float) -> None:
    assert left_behind(60.0, behind_px) <= DELTA_PX + 1e-9


def test_by_its_trust_alone_it_would_be() -> None:
    weight = TR_MAX - SETTINGS.tr_cr
    assert left_behind(60.0, 8.0, cause=Cause.INCOMING) == pytest.approx(8.0 * weight / (weight + 1))


@pytest.mark.parametrize(
    ("step_px", "behind_px", "aside_px"),
    [(6.0, 8.0, 0.0), (60.0, -8.0, 0.0), (60.0, 4.0, 8.0), (60.0, 2.0, 0.0)],
    ids=["it is slow", "it went slower", "it is elsewhere", "it is as predicted"],
)
def test_the_prediction_keeps_its_weight_where_nothing_accelerates(
    step_px: float, behind_px: float, aside_px: float
) -> None:
    weight = TR_MAX - SETTINGS.tr_cr
    off = float(np.hypot(behind_px, aside_px))
    assert left_behind(step_px, behind_px, aside_px) == pytest.approx(off * weight / (weight + 1))


# Edges without a corner


def lost(trusted: int, found: int) -> float:
    """Trust that a new edge without a corner loses beside ``trusted`` edges, of which so many are found."""
    edges, normal, rebel, corners = EdgeTable(50, 2, 2), CircleTable(2), CircleTable(2), CornerTable(50)
    edges.append(trusted + 1)
    rows = np.arange(trusted + 1)
    edges.x[rows] = edges.predicted_x[rows] = corners.x[rows] = 100.0 + 10 * rows
    edges.y[rows] = edges.predicted_y[rows] = corners.y[rows] = 200.0
    edges.cos[rows], edges.sin[rows], edges.bl[rows] = 1.0, 0.0, 12.0
    edges.trust[rows], edges.corner[rows] = TR_MAX, np.where(rows < found, rows, -1)
    edges.trust[trusted], edges.corner[trusted] = SETTINGS.tr_new, -1
    around = Situation(Config(), PINHOLE)
    around.dt_s = DT_S
    edge_expert.update(edges.columns, normal.columns, rebel.columns, corners.columns, 0.0, around, SETTINGS)
    return float(SETTINGS.tr_new - edges.trust[trusted])


@pytest.mark.parametrize("found", [20, 30, 40])
def test_in_a_sharp_image_a_missing_corner_costs_a_whole_point(found: int) -> None:
    assert lost(40, found) == 1.0


@pytest.mark.parametrize(("found", "cost"), [(0, 0.2), (4, 0.2), (6, 0.3), (10, 0.5)])
def test_where_blur_loses_most_it_costs_as_much_less(found: int, cost: float) -> None:
    assert lost(40, found) == pytest.approx(cost)


def test_a_few_edges_show_no_blur() -> None:
    assert lost(14, 0) == 1.0


# New landmarks


@pytest.mark.parametrize(
    ("speed_mps", "flow_pxps"), [(2.0, 50.0), (-2.0, -50.0), (20.0, 100.0)], ids=["slow", "in reverse", "fast"]
)
def test_a_new_landmark_is_looked_for_at_the_scenes_depth_but_not_nearer_than_a_second(
    speed_mps: float, flow_pxps: float
) -> None:
    """100 px from the focus; at 20 m/s and 4 m it would be looked for five times as far on, and lost."""
    edges, normal, corners = EdgeTable(4, 2, 2), CircleTable(2), CornerTable(1)
    around = Situation(Config(), PINHOLE)
    around.speed_mps, around.dt_s, around.camera_height_m = speed_mps, DT_S, 0.0
    corners.x[0], corners.y[0] = around.focus_x + 100.0, around.focus_y
    corners.columns.count = 1
    edge_expert.add(edges.columns, normal.columns, corners.columns, GroupTable(1).columns, around, 1, 0, SETTINGS)
    assert edges.count == 1
    assert edges.speed[0] == pytest.approx(flow_pxps)
