"""The results of a recording, compared with what is known of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lcf_edge.evaluate.truth import Known
from lcf_edge.messages import Kind

MIN_TRUST = 3.0
CLOSE_S = 1.0
BESIDE_M = 0.6  # a larger miss is no contact

Circles = np.ndarray[Any, np.dtype[np.void]]


def rebels(circles: Circles) -> Circles:
    """Return the circles that count: rebels with enough trust."""
    reported: Circles = circles[(circles["kind"] == Kind.REBEL) & (circles["trust"] >= MIN_TRUST)]
    return reported


def is_close(circle: np.void) -> bool:
    """Whether a contact below a second is reported, with a miss that is small or unknown."""
    return bool(0 < circle["ttc"] < CLOSE_S and not abs(circle["lateral"]) > BESIDE_M)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Verdict on one image. ``found``, ``missed``: names of the threats that were due. ``false``: rebels on nothing.

    ``contact``: a contact below a second was reported where there is no threat.
    """

    found: tuple[str, ...]
    missed: tuple[str, ...]
    false: int
    contact: bool


@dataclass(slots=True)
class Threat:
    """One threat of a recording. ``due``, ``found``: images. ``first_ns``: when it was due and found first."""

    due: int = 0
    found: int = 0
    due_first_ns: int = 0
    found_first_ns: int | None = None

    @property
    def late_s(self) -> float:
        """Time until it was found, s; NaN: never."""
        return math.nan if self.found_first_ns is None else (self.found_first_ns - self.due_first_ns) / 1e9


@dataclass(slots=True)
class Score:
    """Adds up verdicts.

    ``due``, ``found``: threats, frame by frame. ``false``: rebels on nothing. ``contacts``: images with a contact
    below a second that does not come. ``step_ms``: time of each image, scored or not.
    """

    scored: int = 0
    due: int = 0
    found: int = 0
    false: int = 0
    contacts: int = 0
    threats: dict[str, Threat] = field(default_factory=dict)
    step_ms: list[float] = field(default_factory=list)

    @property
    def false_per_frame(self) -> float:
        """Rebels on nothing."""
        return self.false / self.scored if self.scored else math.nan

    @property
    def latency_s(self) -> float:
        """Time until a threat is found, s: median of those that are."""
        late = [threat.late_s for threat in self.threats.values() if threat.found]
        return float(np.median(late)) if late else math.nan

    @property
    def median_ms(self) -> float:
        """Median time of a step, ms."""
        return float(np.median(self.step_ms))

    def add(self, stamp_ns: int, reported: Circles, known: Sequence[Known]) -> Verdict:
        """Score the ``rebels`` of one image."""
        on = [[each for each in known if each.holds(circle["x"], circle["y"])] for circle in reported]
        false = sum(not things for things in on)
        contact = any(
            is_close(circle) and not any(each.threat for each in things)
            for circle, things in zip(reported, on, strict=True)
        )
        found: list[str] = []
        missed: list[str] = []
        for each in known:
            if each.is_due:
                is_found = any(each in things for things in on)
                (found if is_found else missed).append(each.name)
                self._add_threat(each.name, stamp_ns, is_found=is_found)
        self.scored += 1
        self.due += len(found) + len(missed)
        self.found += len(found)
        self.false += false
        self.contacts += contact
        return Verdict(tuple(found), tuple(missed), false, contact)

    def _add_threat(self, name: str, stamp_ns: int, *, is_found: bool) -> None:
        threat = self.threats.setdefault(name, Threat(due_first_ns=stamp_ns))
        threat.due += 1
        threat.found += is_found
        if is_found and threat.found_first_ns is None:
            threat.found_first_ns = stamp_ns
