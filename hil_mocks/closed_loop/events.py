"""Events at a distance along a course. Times are those of a vehicle that does not brake."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hil_mocks.closed_loop.draft import Draft
from hil_mocks.closed_loop.world import Body, Leg


def _cross(draft: Draft, at_m: float, late_s: float, *, speed_mps: tuple[float, float] = (0.5, 1.7)) -> None:
    """Crosses; reaches the middle of the course that long after the vehicle."""
    side, speed, lead_s = draft.side(), draft.pace(*speed_mps), draft.between(3.0, 5.5)
    aside, slant = speed * (lead_s + late_s), draft.between(-0.35, 0.35)
    start = draft.course.place(at_m - aside * slant, side * aside)
    end = draft.course.place(at_m + 5.0 * slant, -side * 5.0)
    draft.walker(start, (Leg(*end, speed, from_m=draft.begin(at_m, lead_s)),))


def _crosses_ahead(draft: Draft, at_m: float) -> None:
    _cross(draft, at_m, draft.between(-0.25, 0.25))


def _crosses_long_before(draft: Draft, at_m: float) -> None:
    _cross(draft, at_m, -draft.between(1.5, 2.5))


def _crosses_behind(draft: Draft, at_m: float) -> None:
    _cross(draft, at_m, draft.between(1.5, 2.5))


def _just_misses(draft: Draft, at_m: float) -> None:
    speed = draft.pace(0.6, 1.3)
    away_s = (draft.build.half_width_m + 0.25 + draft.between(0.35, 0.7)) / speed
    late_s = away_s if draft.random.random() < 0.5 else -away_s
    _cross(draft, at_m, late_s, speed_mps=(speed, speed))


def _stops_in_the_middle(draft: Draft, at_m: float) -> None:
    side, speed, lead_s = draft.side(), draft.pace(0.6, 1.4), draft.between(3.0, 5.0)
    start = draft.course.place(at_m, side * speed * (lead_s - draft.between(0.0, 1.0)))
    middle = draft.course.place(at_m, draft.between(-0.15, 0.15))
    end = draft.course.place(at_m + 0.5, -side * 5.0)
    first = Leg(*middle, speed, draft.between(1.0, 2.5), from_m=draft.begin(at_m, lead_s))
    draft.walker(start, (first, Leg(*end, speed)))


def _turns_round(draft: Draft, at_m: float) -> None:
    side, speed, lead_s = draft.side(), draft.pace(0.6, 1.4), draft.between(3.0, 5.0)
    turn_m = side * draft.beside(draft.between(0.5, 1.2))
    start = draft.course.place(at_m, side * (abs(turn_m) + speed * draft.between(1.5, 2.5)))
    turn, end = draft.course.place(at_m, turn_m), draft.course.place(at_m + 1.0, side * 6.0)
    first = Leg(*turn, speed, draft.between(0.1, 0.6), from_m=draft.begin(at_m, lead_s))
    draft.walker(start, (first, Leg(*end, speed)))


def _steps_out(draft: Draft, at_m: float) -> None:
    """Steps out from behind a parked van, near but far enough to stop."""
    side, speed, van_m = draft.side(), draft.pace(0.6, 1.4), draft.between(2.5, 3.5)
    van_right = side * (draft.beside(draft.between(0.5, 0.9)) + 0.75)
    _van(draft, at_m - 0.6 - van_m / 2, van_right, van_m)
    stop_m = 0.6 * draft.cruise_mps + draft.cruise_mps**2 / 3.0 + 1.2
    seen_m = stop_m * draft.between(1.0, 1.5)  # away when he comes out
    hidden_s = (abs(van_right) - draft.beside(0.3)) / speed
    start, end = draft.course.place(at_m, van_right + side * 0.6), draft.course.place(at_m, -side * 5.0)
    draft.walker(start, (Leg(*end, speed, from_m=at_m - seen_m - draft.cruise_mps * hidden_s),))


def _van(draft: Draft, at_m: float, right_m: float, length_m: float) -> None:
    x, z = draft.course.place(at_m, right_m)
    heading = draft.course.heading(at_m)
    draft.bodies.append(Body(f"van_{len(draft.bodies)}", 1.5, 1.9, length_m, x, z, heading, draft.paint(0.25)))


def _comes_towards(draft: Draft, at_m: float, right_m: float) -> None:
    speed, lead_s = draft.between(0.5, 1.4), draft.between(3.5, 5.0)
    start = draft.course.place(at_m + speed * lead_s, right_m)
    legs = _along(draft, at_m + speed * lead_s, at_m - 15.0, right_m, speed, draft.begin(at_m, lead_s))
    (draft.walker if draft.random.random() < 0.7 else draft.cart)(start, legs)


def _along(
    draft: Draft, from_m: float, to_m: float, right_m: float, speed_mps: float, begin_m: float
) -> tuple[Leg, ...]:
    """Legs along the course."""
    count = max(int(abs(to_m - from_m) / 1.5), 1)
    places = np.linspace(from_m, to_m, count + 1)[1:].tolist()
    first, *rest = (Leg(*draft.course.place(place, right_m), speed_mps) for place in places)
    return (replace(first, from_m=begin_m), *rest)


def _oncoming(draft: Draft, at_m: float) -> None:
    _comes_towards(draft, at_m, draft.between(-0.3, 0.3))


def _oncoming_beside(draft: Draft, at_m: float) -> None:
    _comes_towards(draft, at_m, draft.side() * draft.beside(draft.between(0.8, 2.0)))


def _leads_and_brakes(draft: Draft, at_m: float) -> None:
    """Goes ahead more slowly, stops for a moment, turns off."""
    speed, cruise = draft.cruise_mps * draft.between(0.5, 0.8), draft.cruise_mps
    gap = 1.0 + cruise * draft.between(1.2, 2.0)
    begin = draft.begin(at_m, 2.5)
    stop_m = begin + gap + speed * draft.between(2.0, 3.0)
    start, side = draft.course.place(begin + gap), draft.side()
    there = _along(draft, begin + gap, stop_m, 0.0, speed, begin)
    off = Leg(*draft.course.place(stop_m + 3.0, side * 4.5), max(speed, 0.6))
    draft.cart(start, (*there[:-1], replace(there[-1], rest_s=draft.between(1.0, 2.5)), off))


def _cuts_in(draft: Draft, at_m: float) -> None:
    """Goes ahead in the lane beside and moves in front of the vehicle, slower than it; then turns off."""
    speed, cruise, side = draft.cruise_mps * draft.between(0.4, 0.7), draft.cruise_mps, draft.side()
    lane = side * draft.beside(draft.between(1.1, 1.8))
    begin = draft.begin(at_m, 3.5)
    takes_s = draft.between(1.4, 2.2)
    first = begin + draft.between(1.0, 1.4) + 0.5 * cruise + (cruise - speed) * (1.2 + takes_s) + 0.5 * speed
    until, across = first + speed * 1.2, speed * takes_s
    legs = list(_along(draft, first, until, lane, speed, begin))
    legs += [Leg(*draft.course.place(until + across, 0.0), speed)]
    legs += _along(draft, until + across, until + across + 2.0 * speed, 0.0, speed, -math.inf)
    legs += [Leg(*draft.course.place(until + across + 2.0 * speed + 3.0, -side * 4.5), max(speed, 0.6))]
    draft.cart(draft.course.place(first, lane), tuple(legs))


def _leaves(draft: Draft, at_m: float) -> None:
    """Walks away to the side, in sight and beside the path from the beginning."""
    side, speed = draft.side(), draft.between(0.6, 1.5)
    begin = draft.begin(at_m, draft.between(2.0, 3.5))
    start = draft.course.place(at_m, side * draft.beside(draft.between(0.6, 2.5)))
    end = draft.course.place(at_m + draft.between(-1.0, 2.0), side * 9.0)
    draft.walker(start, (Leg(*end, speed, from_m=begin),))


def _crowd(draft: Draft, at_m: float) -> None:
    """Several who walk about beside the path, and one who crosses."""
    for _ in range(int(draft.random.integers(3, 6))):
        side = draft.side()
        places = [
            draft.course.place(at_m + draft.between(-2.0, 3.0), side * draft.beside(draft.between(0.8, 3.5)))
            for _ in range(5)
        ]
        speed = draft.between(0.4, 1.3)
        draft.walker(places[0], tuple(Leg(*place, speed, draft.between(0.0, 0.8)) for place in places[1:]))
    _cross(draft, at_m, draft.between(-0.2, 0.2))


def _box_beside(draft: Draft, at_m: float) -> None:
    """Near the path, and not in the way."""
    for side in (-1, 1):
        size = draft.between(0.4, 1.0), draft.between(0.4, 1.6), draft.between(0.4, 1.0)
        right_m = side * (draft.beside(draft.between(0.2, 0.4)) + math.hypot(size[0], size[2]) / 2)
        draft.stand("beside", at_m + draft.between(-0.5, 0.5), right_m, size, draft.between(-0.4, 0.4))


EVENTS: dict[str, Callable[[Draft, float], None]] = {
    "crosses ahead": _crosses_ahead,
    "crosses long before": _crosses_long_before,
    "crosses behind": _crosses_behind,
    "just misses": _just_misses,
    "stops in the middle": _stops_in_the_middle,
    "turns round": _turns_round,
    "steps out": _steps_out,
    "oncoming": _oncoming,
    "oncoming beside": _oncoming_beside,
    "leads and brakes": _leads_and_brakes,
    "cuts in": _cuts_in,
    "leaves": _leaves,
    "crowd": _crowd,
    "box beside": _box_beside,
}
BLOCKED = "box in the way"
"""The last event of some worlds: there the course ends."""
