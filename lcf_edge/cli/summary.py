"""The short summary at the end of a replay."""

from collections import Counter
from collections.abc import Iterable, Mapping
from enum import IntEnum

import numpy as np
from msgspec.structs import asdict

from lcf_edge.config import Memory
from lcf_edge.messages import Cause, Kind, ObjectClass, PipelineScene
from lcf_edge.printable import counted

_DEFAULT_MEMORY = Memory()
_NEARLY = 0.98  # of its capacity; a row may have been removed since the table was full


class Summary:
    """Adds up scenes. ``memory``: the capacities of the tables."""

    def __init__(self, memory: Memory = _DEFAULT_MEMORY) -> None:
        self.frames = 0
        self.corners = 0
        self.omitted = 0
        self.evicted = 0
        self._capacities = {key: rows for key, rows in asdict(memory).items() if key != "budget_mib"}
        self._full: Counter[str] = Counter()  # frames in which rows were evicted, by the table that was full
        self._evicting = 0  # of these frames
        self._rebel_rows = 0
        self._object_rows = 0
        self._objects: dict[int, ObjectClass] = {}  # last class, by id
        self._normal: set[int] = set()
        self._rebels: dict[int, Cause] = {}  # last cause, by id
        self._notes: Counter[str] = Counter()
        self._stamps_ns: list[int] = []
        self._times_us: list[tuple[int, int, int]] = []

    def add(self, scene: PipelineScene) -> None:
        """One frame."""
        self.frames += 1
        self.corners += scene.sizes.corners
        self.omitted += scene.sizes.omitted
        self.evicted += scene.sizes.evicted
        if scene.sizes.evicted:
            self._evicting += 1
            shares = {key: getattr(scene.sizes, key) / rows for key, rows in self._capacities.items()}
            fullest = max(shares.values())
            self._full.update(key for key, share in shares.items() if share >= min(fullest, _NEARLY))
        things = scene.objects
        self._object_rows += len(things)
        self._objects.update(zip(things["id"].tolist(), map(ObjectClass, things["class_id"].tolist()), strict=True))
        is_rebel = scene.circles["kind"] == Kind.REBEL
        self._normal.update(scene.circles["id"][~is_rebel].tolist())
        rebels = scene.circles[is_rebel]
        self._rebel_rows += len(rebels)
        self._rebels.update(zip(rebels["id"].tolist(), map(Cause, rebels["cause"].tolist()), strict=True))
        self._notes.update(scene.notes)
        self._stamps_ns.append(scene.stamp_ns)
        self._times_us.append((scene.timing.detect, scene.timing.filter, scene.timing.total))

    def lines(self, skipped: Mapping[str, int] | None = None) -> list[str]:
        """Return the lines for the user, after one frame at least.

        ``skipped``: what the recording left out, and how often.
        """
        seconds = (self._stamps_ns[-1] - self._stamps_ns[0]) / 1e9
        median, worst = np.percentile(np.array(self._times_us) / 1e3, (50, 99), axis=0)
        times = ", ".join(
            f"{stage} {median_ms:.2f} / {slow:.2f}"
            for stage, median_ms, slow in zip(("detect", "filter", "total"), median, worst, strict=True)
        )
        lines = [
            f"frames   {self.frames}, {seconds:.1f} s of recording",
            f"objects  {len(self._objects)}{_by_name(self._objects.values(), ObjectClass)}, "
            f"{self._object_rows / self.frames:.2f} a frame",
            f"normal   {counted(len(self._normal), 'circle')}",
            f"rebels   {counted(len(self._rebels), 'circle')}{_by_name(self._rebels.values(), Cause)}, "
            f"{self._rebel_rows / self.frames:.2f} a frame",
            f"psi      {self.omitted / max(self.corners, 1):.1%} of {self.corners / self.frames:.0f} corners "
            "a frame omitted",
            f"time     {times} ms a frame (median / 99 %)",
        ]
        if self.evicted:
            lines.append(
                f"evicted  {counted(self.evicted, 'row')} in {self._evicting} of {counted(self.frames, 'frame')}, "
                f"because a table was full; {self._remedy()}"
            )
        if self._notes:
            lines.append(f"notes    {_counted(self._notes)} frames")
        if skipped:
            lines.append(f"skipped  {_counted(skipped)}")
        return lines

    def _remedy(self) -> str:
        """Return the keys of the tables that were full."""
        keys = " and ".join(f"memory.{key} ({self._capacities[key]})" for key in sorted(self._full))
        fewer = ", or lower filter.corners_target" if "corners" in self._full else ""
        return f"raise {keys}{fewer}"


def _by_name(seen: Iterable[IntEnum], names: type[IntEnum]) -> str:
    """Return how many there are of each, in brackets; empty: none."""
    counts = Counter(seen)
    named = ", ".join(f"{counts[one]} {one.name.lower().replace('_', ' ')}" for one in names if counts[one])
    return f" ({named})" if named else ""


def _counted(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name}: {count}" for name, count in counts.items())
