"""The lens for images of a given size."""

import shutil
from pathlib import Path

import msgspec

from lcf_edge.config import Config
from lcf_edge.daemon.lenses import lens_for


def test_the_lens_of_a_recording_is_known_when_no_file_can_be_opened_any_more(
    config: Config, drive: Path, tmp_path: Path
) -> None:
    recording = shutil.copytree(drive, tmp_path / "drive")
    config = msgspec.structs.replace(config, camera=msgspec.structs.replace(config.camera, recording=str(recording)))
    lens = lens_for(config, 320, 240)
    assert lens.fx == 250.0
    shutil.rmtree(recording)
    assert lens_for(config, 320, 240) == lens
    assert lens_for(config, 160, 120).fx == 125.0
