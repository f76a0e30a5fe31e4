"""What is wrong with an image, in a word or two: few corners, dark, glare, blurred."""

import numpy as np
import numpy.typing as npt

from lcf_edge.corners.image_sums import brightness, fine_share_of_columns, fine_share_of_rows

FEW_CORNERS = 40
DARK = 25  # mean grey level
BURNT_OUT = 250  # grey level of a pixel
GLARE_SHARE = 0.2  # of the image that is burnt out
BLURRED = 0.65  # of the usual sharpness
MEMORY = 0.05  # share by which each image changes the usual sharpness
GREY_STEP_PX, LINE_STEP_PX = 8, 32  # of the samples
FAR_PX = 4

Grey = npt.NDArray[np.uint8]


class ImageQuality:
    """Follows the images of one camera, because lenses differ in sharpness."""

    def __init__(self) -> None:
        self._typical: float | None = None  # sharpness
        self._sums = np.empty(2, np.int32)  # of grey levels, and of pixels that are burnt out

    def notes(self, image: Grey, corners: int) -> tuple[str, ...]:
        """Return what degrades this (height, width) image, in which that many corners were found; usually nothing."""
        height, width = image.shape
        pixels = np.ascontiguousarray(image).reshape(-1).data
        brightness(pixels, width, height, GREY_STEP_PX, BURNT_OUT, self._sums.data)
        (grey, burnt_out), samples = self._sums.tolist(), -(-height // GREY_STEP_PX) * -(-width // GREY_STEP_PX)
        notes: list[str] = []
        if not corners:
            notes.append("no corners")
        elif corners < FEW_CORNERS:
            notes.append("few corners")
        if grey < DARK * samples:
            notes.append("dark")
        if burnt_out > GLARE_SHARE * samples:
            notes.append("glare")
        sharp = sharpness(image)
        typical = sharp if self._typical is None else self._typical
        if sharp < BLURRED * typical:
            notes.append("blurred")
        self._typical = typical + MEMORY * (sharp - typical)
        return tuple(notes)


def sharpness(image: Grey) -> float:
    """Return the mean square difference over 1 px as a share of that over 4 px: 1/4 for steps, 1/16 for long ramps.

    The smaller of rows and columns, because motion blurs one direction only.
    """
    height, width = image.shape
    pixels, first = np.ascontiguousarray(image).reshape(-1).data, LINE_STEP_PX // 2
    along = across = 1.0
    if height > first and width > FAR_PX:
        along = fine_share_of_rows(pixels, width, height, first, LINE_STEP_PX, FAR_PX)
    if width > first and height > FAR_PX:
        across = fine_share_of_columns(pixels, width, height, first, LINE_STEP_PX, FAR_PX)
    return min(along, across)
