"""The records of a scene hold what the filter's tables hold, field by field."""

from typing import Any

import numpy as np
import pytest

from lcf_edge import scene_records
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.tables import CircleTable, ObjectTable, PsiTable, Table
from lcf_edge.lens import Lens
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Kind
from lcf_edge.scene_records import Records

LENSES = {
    "pinhole": Lens(640, 480, 500.0, 510.0, 319.5, 239.5),
    "fisheye": Lens(640, 480, 330.0, 330.0, 319.5, 239.5, "equidistant", (0.02, -0.01, 0.0, 0.0)),
}
OTHER_NAME = {
    "direction": "beta",
    "v_forward": "forward",
    "v_forward_sigma": "forward_sigma",
    "v_right": "right",
    "v_right_sigma": "right_sigma",
    "age": "age_s",
    "unseen": "unseen_s",
}
DERIVED = {"x", "y", "kind", "support", "bearing", "bearing_sigma", "elevation", "elevation_sigma"}


def filled(table: Any) -> Any:
    """Every column another number in every row; all rows in use, in the image and beside it."""
    random = np.random.default_rng(5)
    for name, array in table.arrays.items():
        array[:] = (
            random.integers(1, 200, array.shape) if array.dtype != np.float64 else random.normal(9, 3, array.shape)
        )
        if name == "active":
            array[:] = True
        if name == "trust":
            array[:] = random.uniform(2, 5, array.shape)
    table.x[:], table.y[:] = random.uniform(-200, 840, (2, len(table.x)))
    return table


def check(rows: np.ndarray[Any, Any], table: Table, kept: np.ndarray[Any, Any], lens: Lens) -> None:
    x, y = lens.distort_xy(table.x[kept], table.y[kept])
    assert rows["x"] == pytest.approx(np.clip(x, 0, lens.width - 1), abs=1e-3)
    assert rows["y"] == pytest.approx(np.clip(y, 0, lens.height - 1), abs=1e-3)
    for field in set(rows.dtype.names or ()) - DERIVED:
        column = table.arrays[OTHER_NAME.get(field, field)][kept]
        assert np.array_equal(rows[field], column.astype(rows.dtype[field]), equal_nan=True), field
    if "bearing" in (rows.dtype.names or ()):
        bearing, elevation = lens.bearing(table.x[kept], table.y[kept])
        assert rows["bearing"] == pytest.approx(bearing, abs=1e-6)
        assert rows["elevation"] == pytest.approx(elevation, abs=1e-6)
        assert np.array_equal(rows["support"], np.minimum(table.support[kept], 65535))


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_circles_that_are_trusted_are_reported(lens: Lens) -> None:
    rebels, normals, objects = filled(CircleTable(20)), filled(CircleTable(30)), filled(ObjectTable(8))
    rebels.square[:] = np.arange(20) % 9 - 1
    rebels.support[3] = 70_000
    objects.trust[2], objects.active[2] = 5.0, False  # has just ended
    records, plane = Records(50, CIRCLE), ImagePlane(lens)
    scene_records.add_circles(records, rebels.columns, objects.columns, Kind.REBEL, plane, 3.0)
    number = records.count
    scene_records.add_circles(records, normals.columns, objects.columns, Kind.NORMAL, plane, 3.0)
    rows, owners = records.written(), records.written_owners()
    kept = (rebels.trust >= 3.0).nonzero()[0]
    assert 0 < number == len(kept) < 20
    check(rows[:number], rebels, kept, lens)
    assert (rows["kind"][:number] == Kind.REBEL).all()
    assert (rows["kind"][number:] == Kind.NORMAL).all()
    assert np.isinf(rows["ttc"][number:]).all()
    assert np.isnan(rows[["range", "lateral"]][number:].tolist()).all()
    square = rebels.square[kept]
    owned = (square >= 0) & objects.active[square] & (objects.trust[square] >= 3.0)
    assert np.array_equal(owners, [*np.where(owned, objects.id[square], 0), *[0] * (len(rows) - number)])


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_objects_that_are_trusted_are_reported(lens: Lens) -> None:
    objects = filled(ObjectTable(16))
    objects.range[2] = np.nan
    records = Records(16, OBJECT)
    scene_records.add_objects(records, objects.columns, ImagePlane(lens), 3.0)
    rows, kept = records.written(), (objects.trust >= 3.0).nonzero()[0]
    assert len(rows) == len(kept)
    check(rows, objects, kept, lens)
    # a quarter of its extent in the image, as an angle
    x, y, little = objects.x[kept], objects.y[kept], 1e-4
    bearings = [lens.bearing(x + side * little * objects.width[kept], y)[0] for side in (-1, 1)]
    elevations = [lens.bearing(x, y + side * little * objects.height[kept])[1] for side in (1, -1)]
    assert rows["bearing_sigma"] == pytest.approx(0.25 * (bearings[1] - bearings[0]) / (2 * little), rel=1e-3)
    assert rows["elevation_sigma"] == pytest.approx(0.25 * (elevations[1] - elevations[0]) / (2 * little), rel=1e-3)


def test_psi_regions_are_reported_and_what_lies_between_their_fields_is_zero() -> None:
    psi = filled(PsiTable(16))
    psi.active[::2] = False
    lens = LENSES["pinhole"]
    records = Records(16, PSI_REGION)
    scene_records.add_psi(records, psi.columns, ImagePlane(lens))
    rows = records.written()
    check(rows, psi, psi.active.nonzero()[0], lens)
    assert not rows.view(np.uint8).reshape(-1, PSI_REGION.itemsize)[:, 5:8].any()


def test_what_the_lens_cannot_place_is_not_reported() -> None:
    lens = Lens(320, 240, 120.0, 120.0, 159.5, 119.5, "equidistant", (0.0, 0.0, 0.0, 0.0))
    objects = filled(ObjectTable(4))
    objects.trust[:] = 5.0
    objects.x[1] = 1e6
    records = Records(4, OBJECT)
    scene_records.add_objects(records, objects.columns, ImagePlane(lens), 3.0)
    assert records.written()["id"].tolist() == objects.id[[0, 2, 3]].tolist()


def test_records_that_were_handed_out_stay_as_they_are() -> None:
    objects = filled(ObjectTable(4))
    objects.trust[:] = 5.0
    records, plane = Records(4, OBJECT), ImagePlane(LENSES["pinhole"])
    scene_records.add_objects(records, objects.columns, plane, 3.0)
    rows = records.written()
    before = rows.tobytes()
    records.count = 0
    objects.width[:] = 1.0
    scene_records.add_objects(records, objects.columns, plane, 3.0)
    assert rows.tobytes() == before
