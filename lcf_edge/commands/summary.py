"""The short summary at the end of a replay."""

from collections import Counter
from collections.abc import Mapping

import numpy as np

from lcf_edge.records import Cause, Kind, Scene


class Summary:
    """Adds up scenes."""

    def __init__(self) -> None:
        self.frames = 0
        self.corners = 0
        self.omitted = 0
        self.evicted = 0
        self._rebel_rows = 0
        self._normal: set[int] = set()
        self._rebels: dict[int, Cause] = {}  # the last cause of each
        self._notes: Counter[str] = Counter()
        self._stamps_ns: list[int] = []
        self._times_us: list[tuple[int, int, int]] = []

    def add(self, scene: Scene) -> None:
        """One frame."""
        self.frames += 1
        self.corners += scene.sizes.corners
        self.omitted += scene.sizes.omitted
        self.evicted += scene.sizes.evicted
        is_rebel = scene.circles["kind"] == Kind.REBEL
        self._normal.update(scene.circles["id"][~is_rebel].tolist())
        rebels = scene.circles[is_rebel]
        self._rebel_rows += len(rebels)
        self._rebels.update(zip(rebels["id"].tolist(), map(Cause, rebels["cause"].tolist()), strict=True))
        self._notes.update(scene.notes)
        self._stamps_ns.append(scene.stamp_ns)
        self._times_us.append((scene.timing.detect, scene.timing.filter, scene.timing.total))

    def lines(self, skipped: Mapping[str, int] | None = None) -> list[str]:
        """What a user reads, after one frame at least.

        ``skipped``: what the recording left out, and how often.
        """
        causes = Counter(self._rebels.values())
        named = ", ".join(f"{causes[cause]} {cause.name.lower()}" for cause in Cause if causes[cause])
        seconds = (self._stamps_ns[-1] - self._stamps_ns[0]) / 1e9
        median, worst = np.percentile(np.array(self._times_us) / 1e3, (50, 99), axis=0)
        times = ", ".join(
            f"{stage} {usual:.2f} / {slow:.2f}"
            for stage, usual, slow in zip(("detect", "filter", "total"), median, worst, strict=True)
        )
        lines = [
            f"frames   {self.frames}, {seconds:.1f} s of recording",
            f"normal   {len(self._normal)} circles",
            f"rebels   {len(self._rebels)} circles{f' ({named})' if named else ''}, "
            f"{self._rebel_rows / self.frames:.2f} a frame",
            f"psi      {self.omitted / max(self.corners, 1):.1%} of {self.corners / self.frames:.0f} corners "
            "a frame omitted",
            f"time     {times} ms a frame (median / 99 %)",
        ]
        if self.evicted:
            lines.append(f"evicted  {self.evicted} rows, because a table was full")
        if self._notes:
            lines.append(f"notes    {_counted(self._notes)} frames")
        if skipped:
            lines.append(f"skipped  {_counted(skipped)}")
        return lines


def _counted(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name}: {count}" for name, count in counts.items())
