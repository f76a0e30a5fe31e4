"""The lens for images of a given size."""

from functools import lru_cache
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
        recorded = _recorded(camera.recording)
        return recorded and recorded.scaled(width, height)
    return None


@lru_cache(maxsize=1)
def _recorded(recording: str) -> Lens | None:
    """Read it once: later, when memory is short and half of the corners go, no file may be opened any more."""
    from lcf_edge.recording.read import open_recording  # noqa: PLC0415  # a vehicle does not need it

    return open_recording(Path(recording), Config()).lens
