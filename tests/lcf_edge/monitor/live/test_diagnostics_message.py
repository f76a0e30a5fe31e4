"""Diagnostics as they come over the wire."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.cdr import CdrError, decode_diagnostics, encode_diagnostics
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.monitor.live.traces import Figures

text = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)
status = st.builds(DeviceStatus, text, st.sampled_from(list(Level)), text, st.dictionaries(text, text, max_size=4))


@given(st.integers(0, 2**31 * 10**9 - 1), text, st.lists(status, max_size=4))
def test_what_is_encoded_is_decoded(stamp_ns: int, hardware_id: str, statuses: list[DeviceStatus]) -> None:
    decoded = decode_diagnostics(encode_diagnostics(stamp_ns, hardware_id, statuses))
    assert decoded.header.stamp_ns == stamp_ns
    assert decoded.status == tuple(statuses)
    assert decoded.hardware_id == (hardware_id if statuses else "")


@given(st.binary(max_size=200))
def test_any_bytes_are_decoded_or_refused(data: bytes) -> None:
    try:
        decode_diagnostics(b"\0\1\0\0" + data)
    except CdrError:
        return


def test_counts_without_the_bytes_for_them_and_unknown_levels_are_refused() -> None:
    payload = encode_diagnostics(0, "r", [DeviceStatus("d", Level.OK, "m")])
    for broken in (payload[:16] + b"\xff" * 4 + payload[20:], payload[:20] + b"\x09" + payload[21:], payload[:-1]):
        with pytest.raises(CdrError):
            decode_diagnostics(broken)


@given(text)
def test_a_figure_is_a_number_or_unknown(value: str) -> None:
    figures = Figures(
        decode_diagnostics(
            encode_diagnostics(0, "", [DeviceStatus("pipeline", Level.OK, "", {"psi_fill": value, "x": value})])
        )
    )
    figures.fill("psi")
    number = figures.number("pipeline", "x")
    assert number is None or number == float(value)


@pytest.mark.parametrize("digits", [10, 30, 5000])
def test_a_fill_that_no_table_has_is_unknown(digits: int) -> None:
    """Larger numbers would fit neither ``int`` nor JSON."""
    pipeline = DeviceStatus("pipeline", Level.OK, "", {"psi_fill": f"{'9' * digits}/32", "corners_fill": "3/1500"})
    figures = Figures(decode_diagnostics(encode_diagnostics(0, "", [pipeline])))
    assert figures.fill("psi") is None
    assert figures.fill("corners") == (3, 1500)
