"""What counts as found, false, late, and as a contact that does not come."""

import math

import numpy as np
import pytest

from lcf_edge.evaluate.report import Event, FrameLine, events
from lcf_edge.evaluate.score import Score, rebels
from lcf_edge.evaluate.truth import Known
from lcf_edge.messages import CIRCLE, Kind

MAN = Known("man", (100.0, 100.0, 140.0, 180.0), threat=True)
VAN = Known("van", (300.0, 100.0, 400.0, 180.0))


def circles(*at: tuple[float, float], ttc: float = 3.0, lateral: float = 0.0) -> np.ndarray:
    rows = np.zeros(len(at), CIRCLE)
    rows["kind"], rows["trust"], rows["ttc"], rows["lateral"] = Kind.REBEL, 4.0, ttc, lateral
    rows["x"], rows["y"] = np.array(at).reshape(-1, 2).T
    return rows


def test_a_threat_is_found_by_a_rebel_on_it_and_late_by_when_it_was_first_due() -> None:
    score = Score()
    score.add(1_000_000_000, circles(), [MAN])
    score.add(1_500_000_000, circles((120.0, 140.0)), [MAN])
    score.add(1_600_000_000, circles((83.0, 140.0)), [MAN])  # in the grown box
    assert (score.due, score.found, score.false) == (3, 2, 0)
    assert score.latency_s == 0.5
    assert score.threats["man"].late_s == 0.5


def test_a_threat_that_is_never_found_has_no_latency() -> None:
    score = Score()
    verdict = score.add(1_000_000_000, circles(), [MAN])
    assert verdict.missed == ("man",)
    assert math.isnan(score.threats["man"].late_s)
    assert math.isnan(score.latency_s)


def test_what_is_on_nothing_is_false_and_on_a_known_thing_is_not() -> None:
    score = Score()
    score.add(0, circles((350.0, 140.0), (500.0, 140.0)), [MAN, VAN])
    assert (score.found, score.false, score.false_per_frame) == (0, 1, 1.0)


@pytest.mark.parametrize(
    ("ttc", "lateral", "at", "counts"),
    [
        (0.5, 0.0, (500.0, 140.0), True),
        (0.5, np.nan, (500.0, 140.0), True),
        (0.5, 0.0, (120.0, 140.0), False),  # on a threat it may come
        (0.5, 0.0, (350.0, 140.0), True),
        (0.5, 0.8, (500.0, 140.0), False),
        (1.5, 0.0, (500.0, 140.0), False),
        (np.inf, 0.0, (500.0, 140.0), False),
    ],
)
def test_a_contact_that_does_not_come(ttc: float, lateral: float, at: tuple[float, float], counts: bool) -> None:
    score = Score()
    score.add(0, circles(at, ttc=ttc, lateral=lateral), [MAN, VAN])
    assert score.contacts == counts


def test_small_threats_need_not_be_found() -> None:
    assert not Known("far", (10.0, 10.0, 21.0, 40.0), threat=True).is_due
    assert Known("near", (10.0, 10.0, 22.0, 40.0), threat=True).is_due


def test_rebels_with_trust_count_and_nothing_else() -> None:
    reported = circles((1.0, 1.0), (2.0, 2.0), (3.0, 3.0))
    reported["kind"][0], reported["trust"][1] = Kind.NORMAL, 2.9
    assert rebels(reported)["x"].tolist() == [3.0]


def test_frames_in_a_row_of_which_the_same_can_be_said_are_one_event() -> None:
    lines = [FrameLine(place, place, [], True, (), ("man",) if place in {1, 2, 5} else ()) for place in range(6)]
    assert events(lines) == [Event("missed", 1, 2), Event("missed", 5, 5)]
