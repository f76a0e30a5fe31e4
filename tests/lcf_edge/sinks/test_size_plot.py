"""The plot of the tables' sizes."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.samples import Frame
from lcf_edge.errors import UsageError
from lcf_edge.messages import CIRCLE, PSI_REGION, PipelineScene, Sizes
from lcf_edge.sinks import SinkError
from lcf_edge.sinks.size_plot import SizePlot


def put(plot: SizePlot, sizes: Sizes) -> None:
    """A frame of which the sizes alone matter."""
    scene = PipelineScene(0, 0, 0, 0, 0.0, np.empty(0, CIRCLE), np.empty(0, PSI_REGION), sizes=sizes)
    plot.put(Frame(0, 0, np.empty((0, 0), np.uint8)), scene, lambda: pytest.fail("not looked at"))


def filled(path: Path, frames: int) -> SizePlot:
    plot = SizePlot(path)
    for frame in range(frames):
        put(plot, Sizes(700, 150, 500 + frame, 20 + frame % 5, 30, 12, frame % 3, 14, 4, 0))
    return plot


def test_the_image_shows_a_curve_in_the_colour_of_each_table(tmp_path: Path) -> None:
    path = tmp_path / "sizes.png"
    filled(path, 60).close()
    image = cv2.imread(str(path))
    assert image is not None
    assert image.shape[1] == 1400
    drawn = {tuple(colour) for colour in np.unique(image.reshape(-1, 3), axis=0)}
    curves = ("b8860b", "1f77b4", "d62728", "8c564b", "2ca02c", "17becf", "e377c2", "7f7f7f", "000000")
    assert {(int(c[4:], 16), int(c[2:4], 16), int(c[:2], 16)) for c in curves} <= drawn


def test_a_single_frame_is_enough(tmp_path: Path) -> None:
    path = tmp_path / "sizes.png"
    plot = SizePlot(path)
    put(plot, Sizes())
    plot.close()
    assert cv2.imread(str(path)) is not None


def test_refused_before_the_work_begins(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"sizes\.txt: the name must end in \.png or \.svg or \.pdf"):
        SizePlot(tmp_path / "sizes.txt")
    with pytest.raises(SinkError, match=r"nowhere/sizes\.png: cannot be written"):
        SizePlot(tmp_path / "nowhere" / "sizes.png")


def test_an_image_that_is_there_outlives_a_replay_without_a_frame(tmp_path: Path) -> None:
    path = tmp_path / "sizes.png"
    path.write_bytes(b"kept")
    SizePlot(path).close()
    assert path.read_bytes() == b"kept"
    assert not SizePlot(tmp_path / "new.png").path.exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_error(tmp_path: Path) -> None:
    path = tmp_path / "sizes.png"
    path.symlink_to("/dev/full")
    with pytest.raises(SinkError, match=r"sizes\.png: cannot be written"):
        filled(path, 3).close()


def test_without_matplotlib_the_remedy_is_reported(tmp_path: Path) -> None:
    """A second interpreter in which Matplotlib cannot be found."""
    code = (
        "import sys\n"
        "import importlib.machinery as m\n"
        "find = m.PathFinder.find_spec\n"
        "m.PathFinder.find_spec = lambda name, *rest: None if name == 'matplotlib' else find(name, *rest)\n"
        "from pathlib import Path\n"
        "from lcf_edge.errors import UsageError\n"
        "from lcf_edge.sinks.size_plot import SizePlot\n"
        "try: SizePlot(Path(sys.argv[1]))\n"
        "except UsageError as error: print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "sizes.png")], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip().endswith("pip install 'lcf-edge[plot]'")


def test_only_a_plot_loads_matplotlib() -> None:
    code = "import sys, lcf_edge.sinks.size_plot; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
