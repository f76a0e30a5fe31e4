"""Result lines, options and the wire format are as the documents say."""

import json
import re
import runpy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.cdr import encode_scene
from lcf_edge.cli.command_line import main
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Kind, ObjectClass, ObjectState, PipelineScene, Shape
from lcf_edge.sinks.results import encode_line
from lcf_edge.zenoh_link import ATTACHMENT, SCENE_ENCODING

ROOT = Path(__file__).parents[2]
DECODE = runpy.run_path(str(ROOT / "examples/without_lcf_edge.py"))["decode"]
CDR_TYPES = {"uint8": "u1", "uint16": "<u2", "uint32": "<u4", "float32": "<f4"}

Text = Callable[[str], str]
Blocks = Callable[[str, str], list[str]]
Rows = Callable[[str, str], list[list[str]]]


def scene(circles: int, regions: int, objects: int) -> PipelineScene:
    """Numbers that differ from field to field and from row to row."""
    random = np.random.default_rng(1)
    tables = np.zeros(circles, CIRCLE), np.zeros(regions, PSI_REGION), np.zeros(objects, OBJECT)
    for table in tables:
        for name in table.dtype.names or ():
            table[name] = random.integers(1, 200, len(table))
    rows, psi, things = tables
    return PipelineScene(1_700_000_000_123_456_789, 41, 640, 480, 1.5, rows, psi, objects=things)


def paths(value: Any, prefix: str = "") -> Iterator[str]:
    """Dotted names of the fields of a result line; those of a list's items are under the list's name."""
    for item in value if isinstance(value, list) else [value]:
        for key, inner in item.items():
            yield prefix + key
            if isinstance(inner, dict) or (isinstance(inner, list) and inner and isinstance(inner[0], dict)):
                yield from paths(inner, f"{prefix}{key}.")


def test_fields_of_a_result_line(blocks: Blocks, rows: Rows) -> None:
    known = scene(1, 2, 1)
    known.objects["class_id"], known.objects["state"] = ObjectClass.CROSSING, ObjectState.SEEN
    known.circles["kind"], known.circles["cause"] = Kind.REBEL, 1
    known.psi["shape"] = Shape.CIRCLE, Shape.RECTANGLE
    written = set(paths(json.loads(encode_line(known))))
    (example,) = blocks("docs/replay.md", "json")
    assert set(paths(json.loads(example))) == written
    listed = {name for row in rows("docs/replay.md", "## Result lines") for name in re.findall(r"`([\w.]+)`", row[0])}
    assert "objects.*" in [row[0].strip("`") for row in rows("docs/replay.md", "## Result lines")]
    explained = {name for row in rows("docs/planners.md", "## Objects") for name in re.findall(r"`(\w+)`", row[0])}
    others = {name.removeprefix("objects.") for name in written - listed - {"sizes", "timing_us"}}
    plain = {re.sub(r"_(s|m|mps)$", "", re.sub(r"_sigma(?=_|$)", "", name)) for name in others}
    assert {{"w": "width", "h": "height"}.get(name, name) for name in plain} <= explained | {"id"}
    assert listed <= written


def test_notes_of_a_result_line(rows: Rows) -> None:
    sources = "".join(
        (ROOT / "lcf_edge" / name).read_text(encoding="utf-8")
        for name in ("ego_motion/estimator.py", "corners/image_quality.py", "pipeline.py")
    )
    noted = set(re.findall(r'notes(?:\.append\(|=\(\*\w+\.notes, )"([^"]+)"\)', sources))
    table = rows("docs/replay.md", "### Notes")
    assert {row[0].strip("`") for row in table} == noted


def test_options_of_replay(rows: Rows, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["replay", "--help"])
    offered = set(re.findall(r"(?<![\w-])(--?\w+)", capsys.readouterr().out))
    listed = {option for row in rows("docs/replay.md", "## Options") for option in re.findall(r"`(--?\w+)", row[0])}
    assert listed == offered - {"-h", "--help"}


@given(frame_id=st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=12), n=st.integers(0, 3))
def test_the_wire_format_is_decoded_as_written(frame_id: str, n: int) -> None:
    sent = scene(n, 3 - n, n % 3)
    payload = encode_scene(sent, frame_id)
    stamp_ns, seq, size, speed, circles, psi, objects = DECODE(payload)
    assert (stamp_ns, seq, size, speed) == (sent.stamp_ns, sent.seq, (640, 480), 1.5)
    for got, wanted in ((circles, sent.circles), (psi, sent.psi), (objects, sent.objects)):
        assert all(np.array_equal(got[name], wanted[name]) for name in wanted.dtype.names or ())
    *_, psi, objects = DECODE(payload[: -4 - sent.objects.nbytes])
    assert (len(psi), len(objects)) == (len(sent.psi), 0), "one of before objects"


@pytest.mark.parametrize(("message", "dtype"), [("Circle", CIRCLE), ("PsiRegion", PSI_REGION), ("Object", OBJECT)])
def test_messages_are_the_records(text: Text, message: str, dtype: np.dtype[np.void]) -> None:
    heading = re.search(rf"# lcf_msgs/msg/{message}, (\d+) bytes\n((?:\w+ \w+.*\n)+)", text("docs/wire-format.md"))
    assert heading
    fields = [line.split()[:2] for line in heading[2].splitlines()]
    assert int(heading[1]) == dtype.itemsize
    assert [name for _, name in fields] == list(dtype.names or ())
    assert [np.dtype(CDR_TYPES[kind]) for kind, _ in fields] == [dtype[name] for _, name in fields]


def test_what_goes_with_a_payload(text: Text) -> None:
    document = text("docs/wire-format.md")
    assert f"`{SCENE_ENCODING}`" in document
    assert f"{ATTACHMENT.size} bytes, as rmw_zenoh has it" in document
