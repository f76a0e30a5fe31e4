"""A recording to play: something crosses, and a cart comes."""

from pathlib import Path

import pytest

from lcf_edge.rendered import scenes


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four seconds, 20 frames a second; a walker crosses."""
    made = scenes.make("crossing", 3, seconds=4.0, fps=20.0, width=320, height=240, focal_px=250.0)
    return scenes.write(made, tmp_path_factory.mktemp("replay") / "drive")
