"""The interface of a peer: its input and output."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Config
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens

Bytes = npt.NDArray[np.uint8]
Grey = npt.NDArray[np.uint8]
Circles = npt.NDArray[np.void]  # CIRCLE
Floats = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.intp]


class Peer(Protocol):
    """A method under comparison, for one camera."""

    def __init__(self, config: Config, lens: Lens) -> None: ...

    def process(self, image: Grey, motion: Motion) -> Circles:
        """Rebel circles of one image (height, width); ``motion``: since the image before."""
