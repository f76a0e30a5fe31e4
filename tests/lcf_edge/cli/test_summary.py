"""The summary of a replay counts what was found, each once however long it was there."""

from dataclasses import fields, replace

import numpy as np

from lcf_edge.cli.summary import Summary
from lcf_edge.config import Memory
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, ObjectClass, PipelineScene, Sizes


def seen(seq: int, **objects: ObjectClass) -> PipelineScene:
    """One frame with objects, ``_id=class``."""
    rows = np.zeros(len(objects), OBJECT)
    rows["id"] = [int(name[1:]) for name in objects]
    rows["class_id"] = [*objects.values()]
    return PipelineScene(seq * 10**8, seq, 64, 48, 1.0, np.zeros(0, CIRCLE), np.zeros(0, PSI_REGION), objects=rows)


def test_objects_are_counted_by_their_last_class() -> None:
    summary = Summary()
    summary.add(seen(0, _1=ObjectClass.UNKNOWN, _2=ObjectClass.CUTTING_IN))
    summary.add(seen(1, _1=ObjectClass.STANDING, _2=ObjectClass.CUTTING_IN, _3=ObjectClass.STANDING))
    assert "objects  3 (2 standing, 1 cutting in), 2.50 a frame" in summary.lines()


def test_without_any_it_says_none() -> None:
    summary = Summary()
    summary.add(seen(0))
    assert "objects  0, 0.00 a frame" in summary.lines()


def evicting(seq: int, evicted: int, **rows: int) -> PipelineScene:
    """One frame with this many rows in its tables."""
    return replace(seen(seq), sizes=Sizes(evicted=evicted, **rows))


def eviction_line(summary: Summary) -> str:
    """What is said of evictions."""
    (line,) = (line for line in summary.lines() if line.startswith("evicted"))
    return line


def test_evictions_come_with_the_key_to_raise() -> None:
    summary = Summary(Memory(groups=20))
    summary.add(evicting(0, 0, groups=5, psi=32))
    summary.add(evicting(1, 7, groups=20, psi=3))
    assert (
        eviction_line(summary) == "evicted  7 rows in 1 of 2 frames, because a table was full; raise memory.groups (20)"
    )


def test_where_corners_found_no_place_fewer_are_the_other_way() -> None:
    summary = Summary()
    summary.add(evicting(0, 40, corners=1500, edges_normal=1499, chains=5))
    summary.add(evicting(1, 2, corners=1400, edges_normal=1500))
    assert eviction_line(summary) == (
        "evicted  42 rows in 2 of 2 frames, because a table was full; "
        "raise memory.corners (1500) and memory.edges_normal (1500), or lower filter.corners_target"
    )


def test_where_no_table_is_full_any_more_the_fullest_is_named() -> None:
    summary = Summary()
    summary.add(evicting(0, 1, corners=300, circles_rebel=30))
    assert eviction_line(summary).endswith("; raise memory.circles_rebel (32)")


def test_without_evictions_nothing_is_said_of_them() -> None:
    summary = Summary()
    summary.add(evicting(0, 0, corners=1500))
    assert not [line for line in summary.lines() if line.startswith("evicted")]


def test_every_table_with_a_capacity_is_looked_at() -> None:
    tables = [field.name for field in fields(Sizes) if field.name not in ("omitted", "evicted")]
    for table in tables:
        summary = Summary()
        summary.add(evicting(0, 1, **{table: getattr(Memory(), table)}))
        assert f"raise memory.{table} " in eviction_line(summary)
