"""The lens for images of a given size."""

from pathlib import Path

from lcf_edge.config import Config
from lcf_edge.lens import Lens


def lens_for(config: Config, width: int, height: int) -> Lens:
    """Return the lens for images of that size, by the field of view if nothing better is known. Raises ``LcfError``."""
    return known_lens(config, width, height) or Lens.from_config(config.camera, width, height)


def known_lens(config: Config, width: int, height: int) -> Lens | None:
    """Return the calibrated lens: configured, else a stand-in recording's own. Raises ``LcfError``."""
    camera = config.camera
    if camera.intrinsics:
        return Lens.from_config(camera, width, height)
    if camera.driver == "recording":
        from lcf_edge.recording.read import open_recording  # noqa: PLC0415  # a vehicle does not need it

        recorded = open_recording(Path(camera.recording), config).lens
        return recorded and recorded.scaled(width, height)
    return None
