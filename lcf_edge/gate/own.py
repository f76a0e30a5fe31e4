"""``python -m lcf_edge.gate.own``: the gate that a daemon starts before its own loopback ports.

It ends with the daemon, whose end of standard input is closed then, and puts away the folder of the daemon's socket,
which one that was killed has left.
"""

import argparse
import asyncio
import os
import select
import shutil
import socket
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from lcf_edge.daemon import log
from lcf_edge.gate.entrances import ByUser
from lcf_edge.gate.gate import Gate, serve
from lcf_edge.tallies import Tallies

MAY_BE_KILLED = 500  # before the daemon, where memory is short (oom_score_adj)
STANDARD_INPUT = 0


def main(argv: Sequence[str] | None = None) -> None:
    """Until the daemon ends."""
    parser = argparse.ArgumentParser(prog="python -m lcf_edge.gate.own", allow_abbrev=False)
    parser.add_argument("--listening", type=int, nargs="+", required=True, help="descriptors of sockets")
    parser.add_argument("--tallies", type=int, required=True, help="descriptor")
    parser.add_argument("--to", type=Path, required=True, help="Unix socket of the daemon, in a folder of its own")
    parser.add_argument("--own-keys", nargs="*", default=[], help="that everybody may use")
    arguments = parser.parse_args(argv)
    _step_back()
    log.start("warning")
    tallies = Tallies(arguments.tallies)
    gate = Gate(ByUser(arguments.to, tallies), [key.encode() for key in arguments.own_keys], tallies)
    asyncio.run(serve([socket.socket(fileno=number) for number in arguments.listening], gate, STANDARD_INPUT))
    if select.select([STANDARD_INPUT], [], [], 0)[0]:  # closed
        shutil.rmtree(arguments.to.parent, ignore_errors=True)


def _step_back() -> None:
    """The daemon goes first."""
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(MAY_BE_KILLED), encoding="ascii")
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, max(os.getpriority(os.PRIO_PROCESS, 0), 0))


if __name__ == "__main__":
    main()
