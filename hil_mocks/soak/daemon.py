"""`lcf-edge run` on the stand-ins of the soak: ``python -m hil_mocks.soak.daemon DRIVE.npz SEED [OPTION ...]``.

SIGUSR1 stops the images, and lets them go on.
"""

import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from hil_mocks.soak.stand_ins import FastCamera, FastImu, FastSpeed, Feed
from lcf_edge.cli import command_line
from lcf_edge.messages import Scene
from lcf_edge.recording import playback
from lcf_edge.zenoh_link import link


def main(argv: Sequence[str]) -> NoReturn:
    """Run until a signal ends it."""
    drive, seed, *options = argv
    feed = Feed(Path(drive), int(seed), time.monotonic_ns())

    class TellingLink(link.Link):
        """Notifies the feed of each scene."""

        def put_scene(self, scene: Scene) -> None:
            super().put_scene(scene)
            feed.taken()

    signal.signal(signal.SIGUSR1, lambda *_: feed.pause_or_go_on())
    vars(link).update(Link=TellingLink)
    vars(playback).update(
        RecordedCamera=lambda *_: FastCamera(feed),
        RecordedImu=lambda *_: FastImu(feed),
        RecordedSpeed=lambda *_: FastSpeed(feed),
    )
    command_line.program(["run", *options])


if __name__ == "__main__":
    main(sys.argv[1:])
