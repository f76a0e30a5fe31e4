"""Times of the system clock as dates."""

from datetime import UTC, datetime, timedelta

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LAST_S = (datetime.max.replace(tzinfo=UTC) - _EPOCH) // timedelta(seconds=1)
_FIRST_S = (datetime.min.replace(tzinfo=UTC) - _EPOCH) // timedelta(seconds=1)


def utc(system_ns: int) -> datetime:
    """Return a time of the system clock as a date, to the second; limited to the years 1 to 9999."""
    return _EPOCH + timedelta(seconds=min(max(system_ns // 1_000_000_000, _FIRST_S), _LAST_S))
