"""The order of delivery: by stamp, and before a frame the samples that its interval needs."""

import random
from collections.abc import Sequence
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.samples import ImuSample, SpeedSample
from lcf_edge.recording.read.asl import increasing
from lcf_edge.recording.read.recording import (
    MAX_WAITING_FRAMES,
    MAX_WAITING_SAMPLES,
    Sample,
    UndecodedFrame,
    interleave,
    reorder,
)

stamps = st.lists(st.integers(0, 60), unique=True).map(sorted)


def camera_frame(stamp_ns: int) -> UndecodedFrame:
    return UndecodedFrame(stamp_ns, f"{stamp_ns}", lambda: np.zeros((2, 2), np.uint8))


def imu(stamp_ns: int) -> ImuSample:
    return ImuSample(stamp_ns, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def speed(stamp_ns: int) -> SpeedSample:
    return SpeedSample(stamp_ns, 0.0, 0.0)


def check_delivery(items: Sequence[UndecodedFrame | Sample], kinds: Sequence[type] = (ImuSample, SpeedSample)) -> None:
    """Each kind in its order; before each image exactly the samples up to the first at or after it."""
    for kind in (UndecodedFrame, ImuSample, SpeedSample):
        own = [item.stamp_ns for item in items if isinstance(item, kind)]
        assert own == sorted(set(own))
    for place, item in enumerate(items):
        if not isinstance(item, UndecodedFrame):
            continue
        for kind in kinds:
            before = [x.stamp_ns for x in items[:place] if isinstance(x, kind)]
            every = [x.stamp_ns for x in items if isinstance(x, kind)]
            first = next((t for t in every if t >= item.stamp_ns), None)
            assert before == (every if first is None else [t for t in every if t <= first])


@given(stamps, stamps, stamps)
def test_streams_are_interleaved(frames: list[int], imus: list[int], speeds: list[int]) -> None:
    items = list(interleave(map(camera_frame, frames), map(imu, imus), map(speed, speeds)))
    assert len(items) == len(frames) + len(imus) + len(speeds)
    check_delivery(items)


@given(stamps, stamps, stamps, st.randoms(use_true_random=False))
def test_a_shuffled_stream_is_put_in_order(
    frames: list[int], imus: list[int], speeds: list[int], rng: random.Random
) -> None:
    """Any disorder within what is held is undone, and nothing is lost."""
    frames = frames[:MAX_WAITING_FRAMES]
    every = [*map(camera_frame, frames), *map(imu, imus), *map(speed, speeds)]
    rng.shuffle(every)
    late: list[Any] = []
    items = list(reorder(every, late.append))
    assert not late
    assert len(items) == len(every)
    check_delivery(items)


def test_a_long_stream_is_put_in_order_and_little_of_it_is_held() -> None:
    """Images arrive 40 ms late, at 20/s, next to an IMU at 200/s: as a camera driver delivers them."""
    arrivals = [(t + 40, camera_frame(t)) for t in range(0, 20_000, 50)] + [(t, imu(t)) for t in range(3, 20_000, 5)]
    arrivals.sort(key=lambda arrival: arrival[0])
    taken = delivered = max_held = 0

    def source() -> Any:
        nonlocal taken, max_held
        for _, item in arrivals:
            taken += 1
            max_held = max(max_held, taken - delivered)
            yield item

    items = []
    late: list[Any] = []
    for item in reorder(source(), late.append):
        delivered += 1
        items.append(item)
    assert (len(items), late) == (len(arrivals), [])
    assert max_held <= MAX_WAITING_FRAMES + MAX_WAITING_SAMPLES + 1
    check_delivery(items, kinds=[ImuSample])


def test_what_comes_too_late_or_twice_is_reported() -> None:
    late: list[Any] = []
    camera_frames = [camera_frame(t) for t in range(100, 120)]
    items = list(reorder([*camera_frames, camera_frame(3), imu(110), imu(110)], late.append))
    assert [item.stamp_ns for item in items if isinstance(item, UndecodedFrame)] == list(range(100, 120))
    assert [item.stamp_ns for item in late] == [3, 110]


def test_a_stamp_far_ahead_keeps_nothing_else_waiting() -> None:
    late: list[Any] = []
    items = list(reorder([imu(1), imu(10**15), *map(camera_frame, range(2, 40)), imu(50)], late.append))
    assert [item.stamp_ns for item in items if isinstance(item, UndecodedFrame)] == list(range(2, 40))


def strays(rows: list[int]) -> tuple[list[int], list[int]]:
    lines: list[int] = []
    kept = [item.stamp_ns for item in increasing(((n, imu(t)) for n, t in enumerate(rows)), lines.append)]
    return kept, lines


@given(st.lists(st.integers(0, 30)))
def test_rows_that_are_kept_increase_and_all_others_are_reported(rows: list[int]) -> None:
    kept, lines = strays(rows)
    assert kept == sorted(set(kept))
    assert sorted(kept + [rows[line] for line in lines]) == sorted(rows)


@given(st.integers(0, 9), st.integers(0, 2**62))
def test_one_wrong_stamp_costs_one_row(place: int, wrong: int) -> None:
    rows = [1000 + 10 * n for n in range(10)]
    right = rows[place]
    rows[place] = wrong
    kept, lines = strays(rows)
    ordered = rows == sorted(set(rows))
    assert len(kept) >= 9, (right, wrong)
    assert (len(lines) == 0) == ordered
