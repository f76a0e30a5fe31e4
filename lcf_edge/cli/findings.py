"""The threats of a rendered drive that the filter found, and how soon."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lcf_edge.messages import Cause, Kind, Scene
from lcf_edge.rendered.scenes import ObjectTruth, Truth

GRACE_S = 0.3
"""Threats in sight for less need not be found."""


@dataclass(slots=True)
class FoundThreat:
    """One threat of the drive."""

    name: str
    since_ns: int  # from when it is a threat in sight
    last_ns: int
    found_ns: int | None = None
    found_seq: int | None = None
    causes: Counter[Cause] = field(default_factory=Counter)  # frames

    @property
    def latency_s(self) -> float | None:
        """Time from when it is a threat in sight to the first circle on it, s; None: never found."""
        return None if self.found_ns is None else (self.found_ns - self.since_ns) / 1e9


def trusted_rebels(scene: Scene, trust: float) -> list[tuple[float, float, Cause]]:
    """Return centre (px) and cause of each rebel circle with at least ``trust``."""
    rows = scene.circles[(scene.circles["kind"] == Kind.REBEL) & (scene.circles["trust"] >= trust)]
    return [(float(row["x"]), float(row["y"]), Cause(row["cause"])) for row in rows]


def findings(truths: Iterable[Truth], rebels: Mapping[int, Sequence[tuple[float, float, Cause]]]) -> list[FoundThreat]:
    """Return each threat that was in sight for ``GRACE_S`` or longer.

    ``rebels``: ``trusted_rebels`` by frame number.
    """
    threats: dict[int, FoundThreat] = {}
    for truth in truths:
        for thing in truth.objects:
            if not thing.target:
                continue
            finding = threats.setdefault(thing.id, FoundThreat(thing.name, truth.stamp_ns, truth.stamp_ns))
            finding.last_ns = truth.stamp_ns
            causes = [cause for x, y, cause in rebels.get(truth.seq, ()) if _on(thing, x, y)]
            if causes and finding.found_ns is None:
                finding.found_ns, finding.found_seq = truth.stamp_ns, truth.seq
            finding.causes.update(causes)
    return [threat for threat in threats.values() if threat.last_ns - threat.since_ns >= GRACE_S * 1e9]


def _on(thing: ObjectTruth, x: float, y: float) -> bool:
    """Whether a point lies in the object's box grown by a quarter and 8 px on each side."""
    left, top, width, height = thing.box
    margin = np.array((width, height)) / 4 + 8
    inside = np.abs(np.array((x - left, y - top)) - np.array((width, height)) / 2)
    return bool((inside <= np.array((width, height)) / 2 + margin).all())
