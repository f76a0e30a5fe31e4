"""The keys of ``lcf-edge watch RECORDING``."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lcf_edge.monitor.live.monitor import Replay
    from lcf_edge.monitor.replay.player import Player

SEEK_S = 5.0


class PlayerKeys:
    """Space: play or pause; s: step; arrows: 5 s back and forward; p, n: previous and next alarm; + and -: speed."""

    def __init__(self, player: "Player") -> None:
        self._player = player
        self._keys: Mapping[bytes, Callable[[], None]] = {
            b" ": lambda: player.play(not self._replay().playing),
            b"s": player.step,
            b"\x1b[D": lambda: player.seek(self._replay().position_s - SEEK_S),
            b"\x1b[C": lambda: player.seek(self._replay().position_s + SEEK_S),
            b"p": lambda: player.seek_alarm(forward=False),
            b"n": lambda: player.seek_alarm(forward=True),
            b"+": lambda: player.run_at(self._replay().speed * 2),
            b"-": lambda: player.run_at(self._replay().speed / 2),
        }

    def obey(self, keys: bytes) -> None:
        """Execute the command of each key in turn; ignore other keys."""
        while keys:
            key = next((key for key in self._keys if keys.startswith(key)), keys[:1])
            if key in self._keys:
                self._keys[key]()
            keys = keys[len(key) :]

    def _replay(self) -> "Replay":
        replay = self._player.snapshot().replay
        assert replay is not None
        return replay
