"""What is wrong with an image, in a word or two: few corners, dark, glare, blurred."""

import cv2
import numpy as np
import numpy.typing as npt

FEW_CORNERS = 40
DARK = 25  # mean grey level
BURNT_OUT = 250  # grey level of a pixel
GLARE_SHARE = 0.2  # of the image that is burnt out
BLURRED = 0.65  # of the usual sharpness
MEMORY = 0.05  # share by which each image changes the usual sharpness
GREY_STEP_PX, LINE_STEP_PX = 8, 32  # of the samples

Grey = npt.NDArray[np.uint8]


class ImageQuality:
    """Follows the images of one camera, because lenses differ in sharpness."""

    def __init__(self) -> None:
        self._typical: float | None = None  # sharpness

    def notes(self, image: Grey, corners: int) -> tuple[str, ...]:
        """Return what degrades this (height, width) image, in which that many corners were found; usually nothing."""
        grey = np.ascontiguousarray(image[::GREY_STEP_PX, ::GREY_STEP_PX])
        notes: list[str] = []
        if not corners:
            notes.append("no corners")
        elif corners < FEW_CORNERS:
            notes.append("few corners")
        if cv2.norm(grey, cv2.NORM_L1) < DARK * grey.size:
            notes.append("dark")
        if np.count_nonzero(grey >= BURNT_OUT) > GLARE_SHARE * grey.size:
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
    rows = image[LINE_STEP_PX // 2 :: LINE_STEP_PX]
    columns = np.ascontiguousarray(image[:, LINE_STEP_PX // 2 :: LINE_STEP_PX].T)
    return min(_fine_share(rows), _fine_share(columns))


def _fine_share(lines: Grey) -> float:
    """``lines``: uint8 (n, length), each along a row or a column of the image."""
    if lines.shape[0] == 0 or lines.shape[1] <= 4:
        return 1.0
    near, far = _square_difference(lines, 1), _square_difference(lines, 4)
    return near / max(far, 1.0)


def _square_difference(lines: Grey, apart: int) -> float:
    """Return the mean square difference of pixels ``apart`` px apart, squared grey levels."""
    count = lines.shape[0] * (lines.shape[1] - apart)
    return float(cv2.norm(lines[:, apart:], lines[:, :-apart], cv2.NORM_L2SQR) / count)
