"""No number of a scene is absurd: on recordings it lies within the bounds that docs/wire-format.md states."""

import math
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Config, load
from lcf_edge.evaluate.corpus import find
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, PipelineScene, Scene
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("LCF_EDGE_DATA", ROOT.parent / "shared" / "data"))
SAMPLES = sorted((ROOT / "samples").glob("*.mcap"))
REAL = [entry.path for entry in find([DATA]) if entry.settings] if DATA.is_dir() else []

MAY_BE_UNKNOWN = {"range", "lateral", "closest", "v_forward", "v_right"}
NO_NUMBERS = {"id", "kind", "cause", "class_id", "state", "shape", "support"}
ROW = re.compile(r"^\|([^|]*)\|([^|]*)\|([^|]*)\|$", re.MULTILINE)


def stated() -> dict[str, tuple[str, str]]:
    """Least and most of each field, in the document's words."""
    section = (ROOT / "docs/wire-format.md").read_text(encoding="utf-8").split("\n## Bounds\n")[1].split("\n## ")[0]
    _, _, *rows = ROW.findall(section)
    return {name: (least.strip(), most.strip()) for names, least, most in rows for name in re.findall("`(.+?)`", names)}


BOUNDS = stated()


def bound(words: str, scene: Scene, config: Config) -> float:
    numbers = {
        "above 0": 1e-6,
        "-π/2": -math.pi / 2,
        "π/2": math.pi / 2,
        "width of the image": scene.image_width,
        "height of the image": scene.image_height,
        "10 `vehicle.horizon_s`": 10 * config.vehicle.horizon_s,
        "": math.inf,
    }
    return numbers[words] if words in numbers else float(words.removesuffix(" m"))


def absurd(scene: Scene, config: Config) -> Iterator[str]:
    for rows in (scene.circles, scene.objects, scene.psi):
        for name in set(rows.dtype.names or ()) - NO_NUMBERS:
            values: npt.NDArray[np.float32] = rows[name]
            if name == "ttc":
                values = values[values != math.inf]
            if name in MAY_BE_UNKNOWN or name.endswith("_sigma"):
                values = values[~np.isnan(values)]
            least, most = BOUNDS.get("…_sigma" if name.endswith("_sigma") else name, ("-inf", ""))
            low, high = bound(least, scene, config), np.float32(bound(most, scene, config))
            if not (np.isfinite(values) & (values >= np.float32(low)) & (values <= high)).all():
                yield f"image {scene.seq}: {name} {values.tolist()}"


def test_the_document_bounds_what_a_planner_computes_with() -> None:
    assert {"ttc", "closest", "range", "lateral", "radius", "…_sigma"} <= set(BOUNDS)


@pytest.mark.parametrize("recording", [*SAMPLES, *REAL], ids=lambda path: str(path.stem))
def test_every_number_of_a_recording_is_within_the_stated_bounds(recording: Path) -> None:
    (entry,) = find([recording])
    config = load(None, entry.settings)
    scenes = [outcome.scene for _, outcome in run(open_recording(recording, config), config)]
    assert scenes
    assert not [line for scene in scenes for line in absurd(scene, config)]


@pytest.mark.parametrize(
    ("name", "value"),
    [("range", 28_960_174.0), ("lateral", -1_160_562.0), ("ttc", 812_365.0), ("height", math.inf), ("x", math.nan)],
)
def test_an_absurd_number_is_seen(name: str, value: float) -> None:
    """Or the test above could not fail."""
    things = np.zeros(1, OBJECT)
    things["width"] = things["height"] = 1.0
    scene = PipelineScene(0, 0, 640, 480, 1.0, np.zeros(0, CIRCLE), np.zeros(0, PSI_REGION), objects=things)
    assert not [*absurd(scene, Config())]
    things[name] = value
    (line,) = absurd(scene, Config())
    assert f" {name} " in line
