"""Compiled or not, the same source gives the same bytes."""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import lcf_edge
from lcf_edge.config import Config, Memory
from lcf_edge.filter.inputs import NO_CORNERS
from lcf_edge.lens import Lens
from tests.lcf_edge.filter.boards import LENS as BOARDS_LENS
from tests.lcf_edge.filter.boards import Board
from tests.lcf_edge.filter.test_coarse_motion import LENS as PASSING_LENS
from tests.lcf_edge.filter.test_coarse_motion import SMALL as IN_SMALL
from tests.lcf_edge.filter.test_coarse_motion import Passing

SCRIPT = Path(__file__).with_name("digests.py")
FISHEYE = Lens(640, 480, 330.0, 330.0, 319.5, 239.5, "equidistant", (0.02, -0.01, 0.0, 0.0))
RADIAL = Lens(640, 480, 400.0, 420.0, 325.0, 230.0, "radial-tangential", (-0.28, 0.07, 0.001, -0.0005, 0.0))
SMALL = Memory(edges_normal=90, edges_rebel=20, chains=15, circles_normal=8, circles_rebel=3, groups=6, psi=2)

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]


def run(path: Path, *, pure: bool) -> list[str]:
    """What the script prints: how it ran, and a digest a frame."""
    environment = os.environ | {"PYTHONPATH": str(Path(lcf_edge.__file__).parents[1])}
    environment |= {"LCF_EDGE_PURE": "1"} if pure else {}
    command = [sys.executable, str(SCRIPT), str(path)]
    return subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout.split()


@pytest.mark.parametrize(
    ("config", "lens", "sigma_rad"),
    [
        (Config(), None, 0.002),
        (Config(memory=SMALL), None, 0.0),
        (Config(), FISHEYE, 0.0),
        (Config(), RADIAL, 0.002),
    ],
    ids=["as shipped", "full tables", "fisheye", "radial-tangential"],
)
def test_compiled_and_uncompiled_the_tables_hold_the_same_bytes_after_every_frame(
    config: Config,
    lens: Lens | None,
    sigma_rad: float,
    drive: Drive,
    clutter: Landmarks,
    box: Landmarks,
    tmp_path: Path,
) -> None:
    """A drive with something of everything: what passes, a walker who crosses, a wall ahead, on an arc, shaken."""
    walker = drive(box((-2.2, -0.6, 6), (0.5, 1.2, 0.3)), np.array([1.2, 0, 0]))
    wall = drive(box((0.05, -0.4, 7), (0.5, 0.9, 0.0), seed=5))
    street = replace(drive(clutter(200)) + walker + wall, frames=20, yaw_rate_radps=0.05, sigma_rad=sigma_rad)
    street = replace(street, lens=lens or street.lens, shake_rad=0.01, readout_s=0.02)
    path = tmp_path / "frames"
    path.write_bytes(pickle.dumps((config, street.lens, list(street))))
    (compiled, *digests), (uncompiled, *others) = run(path, pure=False), run(path, pure=True)
    assert uncompiled == "uncompiled"
    if compiled == "uncompiled":
        pytest.skip("nothing is compiled here")
    assert len(digests) == street.frames
    assert [k for k, pair in enumerate(zip(digests, others, strict=True)) if pair[0] != pair[1]] == []


def test_compiled_and_uncompiled_patches_hold_the_same_bytes(tmp_path: Path) -> None:
    path = tmp_path / "frames"
    path.write_bytes(pickle.dumps((Config(), BOARDS_LENS, list(Board(frames=25)))))
    (compiled, *digests), (uncompiled, *others) = run(path, pure=False), run(path, pure=True)
    assert uncompiled == "uncompiled"
    if compiled == "uncompiled":
        pytest.skip("nothing is compiled here")
    assert digests == others


def test_compiled_and_uncompiled_coarse_motion_gives_the_same_bytes(tmp_path: Path) -> None:
    path = tmp_path / "frames"
    frames = [(NO_CORNERS, motion, image, IN_SMALL.of(image)) for motion, image in Passing(turn_rad=0.015)]
    path.write_bytes(pickle.dumps((Config(), PASSING_LENS, frames)))
    (compiled, *digests), (uncompiled, *others) = run(path, pure=False), run(path, pure=True)
    assert uncompiled == "uncompiled"
    if compiled == "uncompiled":
        pytest.skip("nothing is compiled here")
    assert digests == others
