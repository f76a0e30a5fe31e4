"""A threshold of FAST-9 that follows the scene."""


class FollowingThreshold:
    """A threshold in grey levels, kept within ``least`` and ``most`` once it follows."""

    def __init__(self, value: int, least: int, most: int) -> None:
        self.value = value
        self._range = least, most
        self._too_many: bool | None = None  # in the last frame

    def follow(self, ratio: float) -> None:
        """Adapt the threshold for the next frame; ``ratio``: corners found to corners wanted.

        Corner counts fall with its 1.5th to 8th power: a step assumes 2.5, and 5 when the last one went too far.
        """
        swung = self._too_many not in {None, ratio > 1}
        self._too_many = ratio > 1
        power = 0.2 if swung else 0.4
        target = self.value * min(max(ratio**power, 0.6), 1.6)
        least, most = self._range
        value = min(max(round(target), least), most)
        if abs(target - self.value) > 0.2 * power * self.value and value != self.value:
            self.value = value
