"""So much a second passes, and after a pause a second's worth."""

import pytest

from drivers.allowance import Allowance

S = 1_000_000_000


def test_a_seconds_worth_passes_at_once_and_then_what_time_gives() -> None:
    allowance = Allowance(100.0)
    assert allowance.take(150, 5 * S) == 100
    assert allowance.take(1, 5 * S) == 0
    assert allowance.take(50, 5 * S + S // 10) == 10
    assert allowance.take(1000, 100 * S) == 100


@pytest.mark.parametrize("each", [1, 7, 30])
def test_what_is_within_passes_whole(each: int) -> None:
    allowance = Allowance(1000.0)
    assert all(allowance.take(each, turn * each * S // 1000) == each for turn in range(5000))


def test_parts_of_one_add_up() -> None:
    allowance = Allowance(1.0)
    assert sum(allowance.take(1, turn * S // 4) for turn in range(41)) == 11
