"""How fast the vehicle may go."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from lcf_edge.messages import Scene
from lcf_edge.standard_messages import speed_limit
from lcf_edge.standard_messages.positions import Setup

Fields = dict[str, float]
MET = {"probability": 0.9, "ttc": 2.0, "ttc_sigma": 0.25}


@pytest.mark.parametrize(
    ("thing", "vehicle_speed", "limit_mps"),
    [
        (MET, 2.0, 2.0 * 1.5 / 4.0),  # two sigmas early, of a horizon of 4 s
        (MET, -2.0, 0.75),
        ({**MET, "ttc_sigma": math.nan}, 2.0, 1.0),
        ({**MET, "probability": 0.4}, 2.0, math.inf),
        ({**MET, "ttc": math.inf}, 2.0, math.inf),
        ({**MET, "ttc": 0.25}, 2.0, 0.0),
        ({**MET, "ttc": math.nan}, 2.0, 0.0),  # unknown is not far away
        (MET, math.nan, 0.0),
        ({**MET, "probability": 0.4}, math.nan, math.inf),
    ],
)
def test_what_will_be_met_slows_the_vehicle_down(
    scene: Callable[..., Scene], setup: Setup, read: Any, thing: Fields, vehicle_speed: float, limit_mps: float
) -> None:
    met = scene(thing, vehicle_speed=vehicle_speed)
    twist = read(speed_limit.encode_speed_limit(met, setup), speed_limit.MESSAGE)
    assert twist.twist.linear.x == pytest.approx(limit_mps)
    assert twist.header.frame_id == "base_link"
    nav2 = read(speed_limit.encode_nav2_speed_limit(met, setup), speed_limit.NAV2_MESSAGE)
    assert not nav2.percentage
    assert nav2.speed_limit == pytest.approx(max(limit_mps, 0.001) if math.isfinite(limit_mps) else 0.0)


def test_without_objects_there_is_no_limit(scene: Callable[..., Scene]) -> None:
    assert speed_limit.speed_limit_mps(scene(), 4.0) == math.inf
