"""Memory of a process that runs one method, and what its steps allocate and keep.

``python -m benchmarks.memory MODE METHOD FOLDER`` replays a drive that was written to a folder, in a process of its
own, and prints one number: the peak ("peak") or the growth ("kept"), bytes. It reads the configuration as JSON.
"""

import gc
import subprocess
import sys
import tracemalloc
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import cv2
import msgspec
import numpy.ma  # noqa: F401  np.unique loads it when it is first used, which would count as kept

from benchmarks.playing import play_recording
from lcf_edge.config import Config

WARM_UP = 60
STEPS = 200


@dataclass(frozen=True, slots=True)
class Memory:
    """Of one process."""

    method: str
    peak_mib: float
    kept_bytes_a_step: float  # after ``WARM_UP`` frames, over ``STEPS``


def measure(method: str, folder: Path, config: Config) -> Memory:
    """Run a method over the drive in ``folder``, twice, in processes of their own. Raises OSError."""
    peak, kept = (_child(method, folder, config, mode) for mode in ("peak", "kept"))
    return Memory(method, peak / 2**20, kept / STEPS)


def _child(method: str, folder: Path, config: Config, mode: str) -> float:
    command = [sys.executable, "-m", "benchmarks.memory", mode, method, str(folder)]
    done = subprocess.run(command, input=msgspec.json.encode(config), capture_output=True, check=False)
    if done.returncode:
        raise OSError(f"{' '.join(command)}: {done.stderr.decode(errors='replace').strip().splitlines()[-1]}")
    return float(done.stdout)


def _peak(method: str, folder: Path, config: Config) -> int:
    for _ in islice(play_recording(folder, config, [method]), STEPS):
        pass
    return peak_bytes()


def peak_bytes() -> int:
    """Largest resident memory of this process so far.

    Not by ``getrusage``: there a child inherits the peak of the process that started it.
    """
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024
    raise OSError("/proc/self/status: no VmHWM; memory is measured on Linux only")


def _kept(method: str, folder: Path, config: Config) -> int:
    moments = play_recording(folder, config, [method])
    tracemalloc.start()
    for _ in islice(moments, WARM_UP):
        pass
    before = _allocated()
    for _ in islice(moments, STEPS):
        pass
    return _allocated() - before


def _allocated() -> int:
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


def _main(arguments: Sequence[str]) -> int:
    mode, method, folder = arguments
    cv2.setNumThreads(1)
    config = msgspec.json.decode(sys.stdin.buffer.read(), type=Config)
    answer = (_peak if mode == "peak" else _kept)(method, Path(folder), config)
    sys.stdout.write(f"{answer}\n")
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
