"""The overlay shows each thing in its colour, in its panel, and the video holds every frame."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcf_edge.messages import (
    CIRCLE,
    OBJECT,
    PSI_REGION,
    Cause,
    Kind,
    ObjectClass,
    ObjectState,
    PipelineScene,
    Shape,
    Sizes,
    View,
)
from lcf_edge.sinks.overlay import (
    BLUE,
    GREEN,
    GREY,
    LIGHT_BLUE,
    ORANGE,
    RED,
    WHITE,
    YELLOW,
    Colour,
    Image,
    draw,
    found_figures,
)

WIDTH, HEIGHT = 320, 240
NO_POINTS = np.zeros((0, 2), np.float32)
NO_SIZES = Sizes()


def points(*rows: tuple[float, ...]) -> npt.NDArray[np.float32]:
    return np.array(rows, np.float32)


def circle(**fields: Any) -> npt.NDArray[np.void]:
    row = np.zeros(1, CIRCLE)
    row["ttc"] = np.inf
    for name, value in fields.items():
        row[name] = value
    return row


def thing(**fields: Any) -> npt.NDArray[np.void]:
    """A box from (100, 80) to (180, 140)."""
    row = np.zeros(1, OBJECT)
    for name, value in ({"x": 140, "y": 110, "width": 80, "height": 60, "ttc": np.inf} | fields).items():
        row[name] = value
    return row


def region(shape: Shape, x: float, y: float, width: float, height: float) -> npt.NDArray[np.void]:
    return np.array([(1, shape, x, y, width, height, 5)], PSI_REGION)


def scene_of(
    *,
    circles: npt.NDArray[np.void] | None = None,
    psi: npt.NDArray[np.void] | None = None,
    objects: npt.NDArray[np.void] | None = None,
    circle_objects: tuple[int, ...] = (),
    size: tuple[int, int] = (WIDTH, HEIGHT),
    notes: tuple[str, ...] = (),
    sizes: Sizes = NO_SIZES,
) -> PipelineScene:
    return PipelineScene(
        stamp_ns=1_000_000_000,
        seq=1,
        image_width=size[0],
        image_height=size[1],
        vehicle_speed=1.0,
        circles=np.zeros(0, CIRCLE) if circles is None else circles,
        psi=np.zeros(0, PSI_REGION) if psi is None else psi,
        sizes=sizes,
        notes=notes,
        objects=np.zeros(0, OBJECT) if objects is None else objects,
        circle_objects=np.array(circle_objects, np.uint32),
    )


def panels_of(
    *,
    circles: npt.NDArray[np.void] | None = None,
    psi: npt.NDArray[np.void] | None = None,
    objects: npt.NDArray[np.void] | None = None,
    circle_objects: tuple[int, ...] = (),
    grey: int = 60,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    notes: tuple[str, ...] = (),
    **view: Any,
) -> Image:
    width, height = size
    scene = scene_of(circles=circles, psi=psi, objects=objects, circle_objects=circle_objects, size=size, notes=notes)
    parts = {
        "corners": NO_POINTS,
        "omitted": np.zeros(0, np.bool_),
        "edges": NO_POINTS,
        "rebels": NO_POINTS,
        "groups": np.zeros((0, 3), np.float32),
        "edge_group": np.zeros(0, np.intp),
        "focus": points((WIDTH - 20.0, 20.0))[0],
    }
    return draw(np.full((height, width), grey, np.uint8), scene, View(**{**parts, **view}))


def has(panels: Image, x: int, y: int, colour: Colour) -> bool:
    """The colour stands within a pixel of (x, y)."""
    patch = panels[y - 1 : y + 2, x - 1 : x + 2].astype(int)
    return bool((np.abs(patch - colour).max(axis=2) < 60).any())


LEFT_OFFSET, RIGHT_OFFSET = 0, WIDTH

SHOWN: dict[str, tuple[Callable[[], Image], int, int, Colour]] = {
    "corner": (
        lambda: panels_of(corners=points((50, 60)), omitted=np.array([False])),
        LEFT_OFFSET + 50,
        60,
        YELLOW,
    ),
    "omitted corner": (
        lambda: panels_of(corners=points((50, 60)), omitted=np.array([True])),
        LEFT_OFFSET + 50,
        60,
        RED,
    ),
    "edge": (
        lambda: panels_of(edges=points((50, 60)), edge_group=np.array([-1])),
        LEFT_OFFSET + 53,
        60,
        BLUE,
    ),
    "group line": (
        lambda: panels_of(edges=points((50, 60)), edge_group=np.array([0]), groups=points((90, 60, 64))),
        LEFT_OFFSET + 80,
        60,
        GREEN,
    ),
    "psi circle": (
        lambda: panels_of(psi=region(Shape.CIRCLE, 100, 100, 80, 80)),
        LEFT_OFFSET + 140,
        100,
        YELLOW,
    ),
    "psi rectangle": (
        lambda: panels_of(psi=region(Shape.RECTANGLE, 100, 100, 80, 40)),
        LEFT_OFFSET + 70,
        120,
        YELLOW,
    ),
    "normal circle": (
        lambda: panels_of(circles=circle(kind=Kind.NORMAL, x=100, y=100, radius=30)),
        RIGHT_OFFSET + 130,
        100,
        GREEN,
    ),
    "rebel circle": (
        lambda: panels_of(circles=circle(kind=Kind.REBEL, x=100, y=100, radius=30)),
        RIGHT_OFFSET + 70,
        100,
        RED,
    ),
    "object that passes": (lambda: panels_of(objects=thing(probability=0.4)), RIGHT_OFFSET + 100, 110, LIGHT_BLUE),
    "object that will be met": (lambda: panels_of(objects=thing(probability=0.5)), RIGHT_OFFSET + 140, 140, ORANGE),
    "rebel edge": (lambda: panels_of(rebels=points((50, 60))), RIGHT_OFFSET + 47, 60, RED),
    "focus": (lambda: panels_of(focus=points((160, 120))[0]), RIGHT_OFFSET + 160, 120, WHITE),
}


@pytest.mark.parametrize("offset", [LEFT_OFFSET, RIGHT_OFFSET])
def test_own_parts_are_hatched_in_both_panels(offset: int) -> None:
    panels = panels_of(own_parts=(points((30, 30), (100, 30), (100, 100), (30, 100)),))
    for x, y in ((56, 56), (60, 92), (30, 70)):  # on stripes and on the outline
        assert has(panels, offset + x, y, GREY)
    assert not has(panels, offset + 120, 72, GREY)
    assert (panels[40:90, offset + 40 : offset + 90].max(axis=2) < 100).mean() > 0.5  # what is under it can be seen


@pytest.mark.parametrize("thing", SHOWN)
def test_each_thing_has_its_place_and_colour(thing: str) -> None:
    drawn, x, y, colour = SHOWN[thing]
    panels = drawn()
    assert panels.shape == (HEIGHT, 2 * WIDTH, 3)
    assert panels.dtype == np.uint8
    assert has(panels, x, y, colour)
    assert not has(panels, (x + WIDTH) % (2 * WIDTH), y, colour), "in the other panel too"
    assert not has(panels_of(), x, y, colour), "there without the thing"


def text_pixels(panels: Image, reference: Image) -> npt.NDArray[np.intp]:
    """(n, 2) row, column of what differs."""
    return np.argwhere((panels != reference).any(axis=2))


def test_cause_and_time_to_contact_stand_beside_the_rebel_circle() -> None:
    def drawn(cause: Cause, ttc: float) -> Image:
        return panels_of(circles=circle(kind=Kind.REBEL, cause=cause, x=100, y=100, radius=20, ttc=ttc))

    for other in (drawn(Cause.INCOMING, 2.1), drawn(Cause.CROSSING, 3.4), drawn(Cause.CROSSING, np.inf)):
        changed = text_pixels(drawn(Cause.CROSSING, 2.1), other)
        assert len(changed) > 10
        rows, columns = changed.T
        assert 50 < rows.min() < rows.max() < 80  # above the circle
        assert WIDTH + 40 < columns.min() < columns.max() < WIDTH + 160


SIDE = np.s_[85:136, WIDTH + 97 : WIDTH + 104]  # the left side of the box, and what is beside it


def test_what_is_seen_has_a_whole_box_and_what_is_not_a_dashed_and_thinner_one() -> None:
    def blue(state: ObjectState) -> npt.NDArray[np.bool_]:
        drawn = panels_of(objects=thing(state=state))[SIDE].astype(int)
        return (np.abs(drawn - LIGHT_BLUE).max(axis=2) < 60).T  # (column, row)

    seen = blue(ObjectState.SEEN)
    assert seen.any(axis=0).all()
    for state in (ObjectState.HIDDEN, ObjectState.COASTING):
        unseen = blue(state)
        starts = np.diff(unseen.any(axis=0).astype(int)) == 1
        assert 3 <= starts.sum() <= 6
        assert unseen.sum() < seen.sum() / 2


@pytest.mark.parametrize("state", ObjectState)
@pytest.mark.parametrize("grey", [0, 130, 255])
def test_a_box_stands_out_from_any_image(grey: int, state: ObjectState) -> None:
    for probability in (0.0, 1.0):
        side = panels_of(objects=thing(state=state, probability=probability), grey=grey)[SIDE].astype(int)
        brightness = side.mean(axis=2)
        assert np.ptp(brightness[brightness.max(axis=1).argmax()]) > 100  # light beside dark


def test_class_contact_and_its_sigma_stand_beside_the_box() -> None:
    def drawn(kind: ObjectClass, ttc: float, sigma: float) -> Image:
        return panels_of(objects=thing(class_id=kind, ttc=ttc, ttc_sigma=sigma))

    known = drawn(ObjectClass.CROSSING, 2.1, 0.2)
    for other in (
        drawn(ObjectClass.CUTTING_IN, 2.1, 0.2),
        drawn(ObjectClass.CROSSING, 3.4, 0.2),
        drawn(ObjectClass.CROSSING, 2.1, 0.8),
        drawn(ObjectClass.CROSSING, 2.1, np.nan),
        drawn(ObjectClass.CROSSING, np.inf, np.nan),
    ):
        rows, columns = text_pixels(known, other).T
        assert len(rows) > 5
        assert 55 < rows.min() < rows.max() < 80  # above the box
        assert WIDTH + 60 < columns.min() < columns.max() < WIDTH + 220


def test_in_a_crowd_what_passes_gives_up_its_label_and_what_is_met_does_not() -> None:
    place = {"x": 160, "y": 110, "width": 20, "height": 20}
    crowd = np.concatenate([thing(**place, class_id=ObjectClass.STANDING, probability=1.0)] * 8)

    def drawn(kind: ObjectClass, probability: float) -> Image:
        return panels_of(objects=np.concatenate([crowd, thing(**place, class_id=kind, probability=probability)]))

    for probability, is_labelled in ((0.1, False), (0.9, True)):
        changed = text_pixels(drawn(ObjectClass.CROSSING, probability), drawn(ObjectClass.CUTTING_IN, probability))
        assert (len(changed) > 10) == is_labelled


def test_a_circle_of_an_object_has_no_label_of_its_own() -> None:
    rebels = np.concatenate([circle(kind=Kind.REBEL, x=x, y=200, radius=10, ttc=1.0) for x in (60, 250)])
    with_labels, own, none = (panels_of(circles=rebels, circle_objects=of) for of in ((0, 0), (0, 7), (7, 7)))
    left, right = np.s_[172:187, WIDTH : WIDTH + 160], np.s_[172:187, WIDTH + 160 :]
    assert (with_labels[left] == own[left]).all()
    assert text_pixels(own[right], none[right]).size == 0
    assert text_pixels(own[left], none[left]).size > 20
    assert text_pixels(with_labels[right], own[right]).size > 20
    assert (panels_of(circles=rebels) == with_labels).all(), "nobody said which circle is of which object"


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (0, ["", "", "0 normal circles", "0 rebel circles, 0 edges", "0 chains", ""]),
        (1, ["1 object", "1 to be met", "1 normal circle", "1 rebel circle, 1 edge", "1 chain", ""]),
        (2, ["2 objects", "2 to be met", "2 normal circles", "2 rebel circles, 2 edges", "2 chains", ""]),
    ],
)
def test_the_caption_says_one_thing_in_the_singular(number: int, words: list[str]) -> None:
    scene = scene_of(
        circles=np.concatenate([circle(kind=kind) for kind in (Kind.REBEL, Kind.NORMAL) for _ in range(number)])
        if number
        else None,
        objects=np.concatenate([thing(probability=0.9)] * number) if number else None,
        sizes=Sizes(edges_rebel=number, chains=number),
    )
    assert [text for text, _ in found_figures(scene)] == words


def test_the_caption_counts_objects() -> None:
    changed = text_pixels(panels_of(objects=thing(x=np.nan)), panels_of())
    assert len(changed) > 10
    assert changed[:, 0].min() >= HEIGHT - 20


@pytest.mark.parametrize(("x", "y"), [(-10, -10), (WIDTH + 5, 4), (3, HEIGHT), (WIDTH, HEIGHT)])
def test_a_label_never_leaves_its_panel(x: float, y: float) -> None:
    """Whole inside: as many pixels of it as in the middle of the image."""

    def letters(x: float, y: float) -> int:
        rebel = {"kind": Kind.REBEL, "x": x, "y": y, "radius": 1}
        one, other = (panels_of(circles=circle(**rebel, cause=Cause.CROSSING, ttc=ttc)) for ttc in (1.1, 8.8))
        changed = text_pixels(one, other)
        assert (changed[:, 1] >= WIDTH).all(), "spilled into the left panel"
        return len(changed)

    assert letters(x, y) == pytest.approx(letters(160, 120), rel=0.5)


def test_labels_of_neighbours_do_not_cover_each_other() -> None:
    rebel = {"kind": Kind.REBEL, "cause": Cause.CROSSING, "y": 100, "radius": 15}
    alone = [panels_of(circles=circle(**rebel, x=x, ttc=1)) for x in (100, 110)]
    both = panels_of(circles=np.concatenate([circle(**rebel, x=x, ttc=1) for x in (100, 110)]))
    empty = panels_of()
    above = np.s_[60:82, WIDTH:]
    assert (text_pixels(both[above], empty[above]).size) < 1.2 * text_pixels(alone[0][above], empty[above]).size


def test_notes_stand_in_the_caption() -> None:
    changed = text_pixels(panels_of(notes=("no imu",)), panels_of())
    assert len(changed) > 10
    assert changed[:, 0].min() >= HEIGHT - 20


@settings(max_examples=40, deadline=None)
@given(
    x=st.floats(width=32),
    y=st.floats(width=32),
    radius=st.floats(width=32),
    ttc=st.floats(width=32),
    state=st.sampled_from(ObjectState),
    size=st.sampled_from([(1, 1), (33, 7), (64, 48), (320, 240)]),
)
def test_no_value_breaks_the_drawing(
    x: float, y: float, radius: float, ttc: float, state: ObjectState, size: tuple[int, int]
) -> None:
    circles = np.concatenate([circle(kind=kind, x=x, y=y, radius=radius, ttc=ttc) for kind in Kind])
    panels = panels_of(
        circles=circles,
        psi=np.concatenate([region(shape, x, y, radius, radius) for shape in Shape]),
        objects=thing(
            x=x, y=y, width=radius, height=ttc, ttc=ttc, ttc_sigma=radius, probability=x, state=state, class_id=state
        ),
        corners=points((x, y)),
        omitted=np.array([False]),
        edges=points((x, y)),
        edge_group=np.array([0]),
        groups=points((y, x, radius)),
        rebels=points((x, y)),
        focus=points((x, y))[0],
        size=size,
    )
    assert panels.shape == (size[1], 2 * size[0], 3)
