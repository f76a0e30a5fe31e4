"""The recording that is shown, and the commands that a viewer can give."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import msgspec

from lcf_edge.config import Config
from lcf_edge.recording.pace import Pace

if TYPE_CHECKING:  # a viewer of a daemon needs no pipeline, which takes memory
    from lcf_edge.monitor.replay.player import Player


@dataclass(frozen=True, slots=True)
class Replayed:
    """A recording in place of a daemon."""

    path: Path
    config: Config
    pace: Pace

    def player(self, changed: Callable[[], None] = lambda: None) -> "Player":
        """Return its player, not started. Raises ``RecordingError``."""
        from lcf_edge.monitor.replay.player import Player  # noqa: PLC0415

        return Player(self.path, self.config, self.pace, changed=changed)


class Command(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A command. ``value``: position, s after the first image, or speed as a multiple of real time."""

    do: Literal["play", "pause", "step", "seek", "speed", "previous", "next"]
    value: float = 0.0

    def give(self, player: "Player") -> None:
        """Execute it."""
        match self.do:
            case "play" | "pause":
                player.play(self.do == "play")
            case "step":
                player.step()
            case "seek":
                player.seek(self.value)
            case "speed":
                player.run_at(self.value)
            case "previous" | "next":
                player.seek_alarm(forward=self.do == "next")
