"""Results of a soak test, computed from the daemon's diagnostics."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lcf_edge.diagnostics import DeviceStatus

WARM_UP = 20_000  # images of a life, or its first half, whose memory is not looked at: pools and caches fill
PER_FRAMES = 100_000

Parts = Mapping[str, DeviceStatus]


@dataclass(frozen=True, slots=True)
class Balance:
    """Balance of the images of one run."""

    delivered: int
    put: int
    overtaken: int

    @classmethod
    def of(cls, parts: Parts) -> "Balance":
        """As the diagnostics report it."""
        camera = parts["camera"].values
        return cls(
            int(camera.get("delivered", 0)),
            int(parts["pipeline"].values["scenes"]),
            int(camera["overtaken before the pipeline"]),
        )

    @property
    def lost(self) -> int:
        """Unaccounted frames; while images come, one or two are in transit."""
        return self.delivered - self.put - self.overtaken


@dataclass(slots=True)
class Life:
    """One run of the daemon. ``memory``: images put so far, and MiB that were resident then."""

    seed: int
    memory: list[tuple[int, float]] = field(default_factory=list)
    balance: Balance = Balance(0, 0, 0)
    counts: Counter[str] = field(default_factory=Counter)  # faults, and what the daemon counted of them
    gave_up: str = ""  # to save memory
    seconds: float = math.nan
    received: int = 0  # scenes, by a subscriber
    end: str = ""  # how it was ended
    ended_s: float = math.nan  # how long that took

    def note(self, parts: Parts) -> None:
        """Take a second's diagnostics."""
        self.balance = Balance.of(parts)
        self.memory.append((self.balance.put, float(parts["memory"].values["resident_mib"])))
        if parts["memory"].message.startswith("gave up"):
            self.gave_up = parts["memory"].message
        reported = {
            f"{name} {what}": int(value)
            for name in ("camera", "imu", "speed")
            if name in parts
            for what, value in parts[name].values.items()
            if what.startswith(("fault", "opened", "failed", "dropped"))
        }
        refused = {what: int(value) for what, value in parts["pipeline"].values.items() if what.startswith("refused")}
        self.counts = Counter(reported | refused)


def slope(lives: Sequence[Sequence[tuple[int, float]]]) -> tuple[float, float]:
    """MiB in ``PER_FRAMES`` images that all lives have in common, and its 1 sigma; NaN: too little was seen.

    A straight line with an offset of its own for each life, fitted by least squares to what comes after the warm-up.
    Successive values resemble each other, which widens sigma as a first-order autoregression does.
    """
    frames, mib = [], []
    for memory in lives:
        rows = np.array(memory, np.float64).reshape(-1, 2)
        rows = rows[rows[:, 0] >= _warm(memory)]
        if len(rows) > 2:
            frames.append(rows[:, 0] - rows[:, 0].mean())
            mib.append(rows[:, 1] - rows[:, 1].mean())
    x, y = (np.concatenate(parts) if parts else np.zeros(0) for parts in (frames, mib))
    spread, free = float(x @ x), len(x) - len(frames) - 1
    if free < 1 or not spread:
        return math.nan, math.nan
    rise = float(x @ y) / spread
    left = y - rise * x
    total = float(left @ left)
    alike = min(max(float(left[1:] @ left[:-1]) / total, 0.0), 0.999) if total else 0.0
    sigma = math.sqrt(total / free / spread * (1 + alike) / (1 - alike))
    return PER_FRAMES * rise, PER_FRAMES * sigma


def lines(lives: Sequence[Life]) -> list[str]:
    """The report."""
    balances = [life.balance for life in lives]
    put = sum(one.put for one in balances)
    report = [f"{'life':>4} {'pictures':>9} {'/s':>5} {'MiB warm':>8} {'end':>6}  {'ended by':<8} after"]
    for number, life in enumerate(lives, 1):
        warm, end = _warm_and_end(life.memory)
        report.append(
            f"{number:>4} {life.balance.put:>9} {life.balance.put / life.seconds:>5.0f} {warm:>8.1f} {end:>6.1f}"
            f"  {life.end:<8} {life.ended_s:.2f} s"
        )
    rise, sigma = slope([life.memory for life in lives])
    counts = sum((life.counts for life in lives), Counter[str]())
    return [
        *report,
        f"images: {sum(one.delivered for one in balances)} delivered, {put} put, "
        f"{sum(one.overtaken for one in balances)} overtaken, {sum(one.lost for one in balances)} lost",
        f"scenes received by the subscriber: {sum(life.received for life in lives)} of {put}",
        f"restarts: {len(lives) - 1}",
        "counted: " + (", ".join(f"{what} {number}" for what, number in sorted(counts.items())) or "nothing"),
        f"memory: {rise:+.3f} MiB per {PER_FRAMES} images, 1 sigma {sigma:.3f}",
    ]


def _warm_and_end(memory: Sequence[tuple[int, float]]) -> tuple[float, float]:
    """MiB after the warm-up, and last."""
    if not memory:
        return math.nan, math.nan
    return next(mib for frames, mib in memory if frames >= _warm(memory)), memory[-1][1]


def _warm(memory: Sequence[tuple[int, float]]) -> float:
    """Images after which it is warm."""
    return min(WARM_UP, memory[-1][0] / 2) if memory else 0


def complaints(lives: Sequence[Life], allowed_mib: float) -> list[str]:
    """Violations: one line each."""
    found = [f"life {n}: {life.balance.lost} images lost" for n, life in enumerate(lives, 1) if life.balance.lost]
    found += [f"life {n}: {life.gave_up}" for n, life in enumerate(lives, 1) if life.gave_up]
    found += [
        f"life {n}: SIGTERM took {life.ended_s:.1f} s"
        for n, life in enumerate(lives, 1)
        if life.end == "SIGTERM" and life.ended_s > 2
    ]
    rise, sigma = slope([life.memory for life in lives])
    if rise - 3 * sigma > allowed_mib:
        found.append(f"memory grows by {rise:.2f} MiB per {PER_FRAMES} images, {allowed_mib:g} are allowed")
    return found
