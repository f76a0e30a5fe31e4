"""Carries out commands in the guest: ``python -m hil_mocks.vm.guest.agent PORT``.

A line with a ``Command`` as JSON comes in, a line with its ``Outcome`` goes out, one at a time.
"""

import subprocess
import sys
from io import BufferedReader, BufferedWriter
from pathlib import Path
from typing import BinaryIO

import msgspec


class Command(msgspec.Struct):
    """What to run in a shell, as root; ``number`` comes back with the outcome."""

    number: int
    shell: str
    timeout_s: float


class Outcome(msgspec.Struct):
    """Exit status (124: it took too long and was killed) and what was written, errors included."""

    number: int
    status: int
    output: str


def carry_out(command: Command) -> Outcome:
    """Run it."""
    try:
        done = subprocess.run(
            ("timeout", "--kill-after=2", f"{command.timeout_s:g}", "sh", "-c", command.shell),
            check=False,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=command.timeout_s + 5,
        )
    except subprocess.TimeoutExpired as error:  # a grandchild keeps the pipe open
        return Outcome(command.number, 124, (error.output or b"").decode(errors="replace"))
    return Outcome(command.number, done.returncode, done.stdout.decode(errors="replace"))


def serve(incoming: BinaryIO, outgoing: BinaryIO) -> None:
    """Carry out commands until the other end goes away; a line that is no command is passed over."""
    for line in incoming:
        try:
            command = msgspec.json.decode(line, type=Command)
        except msgspec.DecodeError:
            continue
        outgoing.write(msgspec.json.encode(carry_out(command)) + b"\n")
        outgoing.flush()


if __name__ == "__main__":
    with Path(sys.argv[1]).open("r+b", buffering=0) as port:  # it can be open once
        serve(BufferedReader(port), BufferedWriter(port))
