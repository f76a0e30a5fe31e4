"""Letters stand side by side in the order of the text, as OpenCV draws them, without its fonts."""

from importlib.resources import files

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.sinks.lettering import HEIGHT_PX, LETTERS, Mask, lettering

OVERLAP_PX = 2


def drawn_by_opencv() -> Mask:
    """What ``letters.png`` is made of."""
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, 0.42
    cells = []
    for letter in LETTERS:
        advance_px = round(cv2.getTextSize(letter * 20, font, scale, 1)[0][0] / 20)
        cell = np.zeros((1 + HEIGHT_PX, advance_px + OVERLAP_PX), np.uint8)
        cv2.putText(cell, letter, (OVERLAP_PX // 2, 12), font, scale, (255,), 1, cv2.LINE_AA)
        cell[0] = 0
        cell[0, 0] = 255
        cells.append(cell)
    return np.concatenate(cells, axis=1)


@pytest.mark.skipif(int(cv2.__version__.split(".")[0]) < 5, reason="another OpenCV has other fonts")
def test_the_letters_are_those_of_opencv() -> None:
    packed = np.frombuffer((files("lcf_edge.sinks") / "letters.png").read_bytes(), np.uint8)
    np.testing.assert_array_equal(cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE), drawn_by_opencv())


@given(st.text(LETTERS, max_size=30), st.text(LETTERS, max_size=30))
def test_a_text_is_its_parts_side_by_side(first: str, second: str) -> None:
    both, left, right = lettering(first + second), lettering(first), lettering(second)
    assert both.shape == (HEIGHT_PX, left.shape[1] + right.shape[1] - OVERLAP_PX)
    start = left.shape[1] - OVERLAP_PX
    np.testing.assert_array_equal(both[:, :start], left[:, :start])
    np.testing.assert_array_equal(both[:, left.shape[1] :], right[:, OVERLAP_PX:])


def test_every_letter_but_the_space_has_ink_and_its_own() -> None:
    inks = {letter: lettering(letter).tobytes() for letter in LETTERS}
    assert [letter for letter, ink in inks.items() if not any(ink)] == [" "]
    assert len(set(inks.values())) == len(LETTERS)


def test_plus_minus_is_a_plus_with_a_bar_under_it() -> None:
    plus, both = lettering("+").astype(int), lettering("±").astype(int)
    assert both.shape == plus.shape
    rows = np.flatnonzero(both.max(axis=1) > 200)
    assert 0 < rows.min() < rows.max() < HEIGHT_PX - 1
    np.testing.assert_array_equal(both[rows.max()], plus[plus.sum(axis=1).argmax()])
    np.testing.assert_array_equal(both[: rows.max() - 1].sum(axis=0), plus.sum(axis=0))


def test_a_zero_is_empty_inside_and_narrower_than_an_o() -> None:
    zero = lettering("0")
    assert zero.shape == lettering("8").shape
    rows, columns = np.nonzero(zero > 128)
    assert np.ptp(columns) < np.ptp(np.nonzero(lettering("O") > 128)[1])
    inside = zero[rows.min() + 2 : rows.max() - 1, (columns.min() + columns.max()) // 2]
    assert len(inside) >= 4
    assert inside.max() < 64  # no stroke across it


def test_what_it_cannot_write_is_a_question_mark() -> None:
    np.testing.assert_array_equal(lettering("ψ\n"), lettering("??"))
