"""The tables' columns as typed memory for the loops. ``tables`` defines each column."""

from collections.abc import Mapping
from typing import Any

Memory = Mapping[str, Any]

OWN_PART_S = 1.0  # an edge that stays on its pixel for this long moves with the camera


class EdgeColumns:
    """Of an ``EdgeTable``; the first ``count`` rows are in use."""

    def __init__(self, memory: Memory) -> None:
        self.count = 0
        self.capacity = len(memory["x"])
        self.x, self.y, self.beta, self.speed = memory["x"], memory["y"], memory["beta"], memory["speed"]
        self.bl, self.trust, self.deviation = memory["bl"], memory["trust"], memory["deviation"]
        self.origin_x, self.origin_y = memory["origin_x"], memory["origin_y"]
        self.key_x, self.key_y, self.born_key = memory["key_x"], memory["key_y"], memory["born_key"]
        self.circle, self.square, self.suspect_keys = memory["circle"], memory["square"], memory["suspect_keys"]
        self.rebel, self.held, self.matched = memory["rebel"], memory["held"], memory["matched"]
        self.appearance, self.words = memory["appearance"], memory["words"]
        self.predicted_x, self.predicted_y = memory["predicted_x"], memory["predicted_y"]
        self.predicted_speed, self.cos, self.sin = memory["predicted_speed"], memory["cos"], memory["sin"]
        self.fixed_x, self.fixed_y, self.fixed_s = memory["fixed_x"], memory["fixed_y"], memory["fixed_s"]
        self.variance_along, self.variance_across = memory["variance_along"], memory["variance_across"]
        self.covariance_speed, self.variance_speed = memory["covariance_speed"], memory["variance_speed"]
        self.corner, self.best, self.cost, self.psi = memory["corner"], memory["best"], memory["cost"], memory["psi"]

    def own_way(self, i: int) -> bool:
        """Whether an edge is not bound to a flow line: rebels and chains."""
        return self.rebel[i] != 0 or self.suspect_keys[i] > 0

    def is_own_part(self, i: int) -> bool:
        """Whether an edge has not moved in the image: a part of the vehicle, or dirt on the lens."""
        return self.fixed_s[i] >= OWN_PART_S

    def rebels(self) -> int:
        """Rows of E_r."""
        number = 0
        for i in range(self.count):
            number += self.rebel[i] != 0
        return number

    def chains(self) -> int:
        """Rows of α."""
        number = 0
        for i in range(self.count):
            number += self.suspect_keys[i] > 0 and self.rebel[i] == 0
        return number


class CircleColumns:
    """Of a ``CircleTable``. ``evicted``: circles, old or new, that did not fit since it was set to 0."""

    def __init__(self, memory: Memory) -> None:
        self.capacity = len(memory["x"])
        self.evicted = 0
        self.active, self.id, self.support, self.cause = (
            memory["active"],
            memory["id"],
            memory["support"],
            memory["cause"],
        )
        self.x, self.y, self.radius, self.beta = memory["x"], memory["y"], memory["radius"], memory["beta"]
        self.speed, self.expansion, self.trust = memory["speed"], memory["expansion"], memory["trust"]
        self.corr, self.width, self.height = memory["corr"], memory["width"], memory["height"]
        self.ttc, self.range, self.lateral = memory["ttc"], memory["range"], memory["lateral"]
        self.unseen_s, self.square = memory["unseen_s"], memory["square"]


class ObjectColumns:
    """Of an ``ObjectTable``."""

    def __init__(self, memory: Memory) -> None:
        self.capacity = len(memory["x"])
        self.active, self.id, self.class_id = memory["active"], memory["id"], memory["class_id"]
        self.state, self.support, self.trust = memory["state"], memory["support"], memory["trust"]
        self.recent_edges, self.left = memory["recent_edges"], memory["left"]
        self.watched, self.looks = memory["watched"], memory["looks"]
        self.x, self.y, self.width, self.height = memory["x"], memory["y"], memory["width"], memory["height"]
        self.looming, self.sideways = memory["looming"], memory["sideways"]
        self.mm, self.qq, self.mq, self.log_odds = memory["mm"], memory["qq"], memory["mq"], memory["log_odds"]
        self.inverse, self.inverse_var = memory["inverse"], memory["inverse_var"]
        self.steady, self.steady_speed = memory["steady"], memory["steady_speed"]
        self.steady_var, self.steady_inverse = memory["steady_var"], memory["steady_inverse"]
        self.reference, self.middle, self.middle_sigma = memory["reference"], memory["middle"], memory["middle_sigma"]
        self.foot, self.age_s, self.unseen_s = memory["foot"], memory["age_s"], memory["unseen_s"]
        self.ttc, self.ttc_sigma = memory["ttc"], memory["ttc_sigma"]
        self.range, self.range_sigma = memory["range"], memory["range_sigma"]
        self.lateral, self.lateral_sigma = memory["lateral"], memory["lateral_sigma"]
        self.forward, self.forward_sigma = memory["forward"], memory["forward_sigma"]
        self.right, self.right_sigma = memory["right"], memory["right_sigma"]
        self.closest, self.closest_sigma = memory["closest"], memory["closest_sigma"]
        self.probability = memory["probability"]


class PsiColumns:
    """Of a ``PsiTable``. ``live_count``: entries of ``live``."""

    def __init__(self, memory: Memory) -> None:
        self.capacity = len(memory["x"])
        self.active, self.id, self.shape, self.circle = (
            memory["active"],
            memory["id"],
            memory["shape"],
            memory["circle"],
        )
        self.x, self.y, self.width, self.height = memory["x"], memory["y"], memory["width"], memory["height"]
        self.trust, self.expansion, self.life_s = memory["trust"], memory["expansion"], memory["life_s"]
        self.edges, self.missing, self.new = memory["edges"], memory["missing"], memory["new"]
        self.live_count = 0
        self.live = memory["live"]


class GroupColumns:
    """Of a ``GroupTable``; the first ``count`` rows are in use."""

    def __init__(self, memory: Memory) -> None:
        self.count = 0
        self.capacity = len(memory["x"])
        self.x, self.y, self.bs = memory["x"], memory["y"], memory["bs"]
        self.trust, self.row = memory["trust"], memory["row"]


class CornerColumns:
    """Of a ``CornerTable``; the first ``count`` rows are in use."""

    def __init__(self, memory: Memory) -> None:
        self.count = 0
        self.x, self.y, self.pixel_x, self.pixel_y = memory["x"], memory["y"], memory["pixel_x"], memory["pixel_y"]
        self.words, self.psi = memory["words"], memory["psi"]
        self.omitted, self.free, self.taken = memory["omitted"], memory["free"], memory["taken"]
        self.expected, self.edge, self.cost = memory["expected"], memory["edge"], memory["cost"]
