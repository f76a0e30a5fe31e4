"""The threads of the daemon share one heap, and what only its start needed is not kept in memory."""

import subprocess
import sys

import pytest

from lcf_edge.daemon.heap import as_in_files

COUNT_HEAPS = """
import ctypes, sys, threading
from lcf_edge.daemon.heap import use_one_heap
if sys.argv[1] == "one":
    assert use_one_heap()
allocate = ctypes.CDLL(None).malloc
go_on, begun = threading.Event(), threading.Barrier(5)

def work():
    for _ in range(100):
        allocate(1000)
    begun.wait()
    go_on.wait()

threads = [threading.Thread(target=work) for _ in range(4)]
for thread in threads:
    thread.start()
begun.wait()
with open("/proc/self/maps") as maps:
    starts = [int(line.split("-")[0], 16) for line in maps if len(line.split()) == 5 and " rw-p " in line]
print(sum(start % 2**26 == 0 for start in starts))  # where glibc begins a thread's heap: a multiple of 64 MiB
go_on.set()
"""


@pytest.mark.parametrize(("heaps", "has_others"), [("one", False), ("as many as glibc likes", True)])
def test_threads_have_no_heaps_of_their_own(heaps: str, has_others: bool) -> None:
    command = (sys.executable, "-c", COUNT_HEAPS, heaps)
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert (int(output) > 0) == has_others


LEAVE_START = """
import cv2, numpy as np
from pathlib import Path
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.daemon.heap import leave_start
from lcf_edge.config import Filter
from lcf_edge.lens import Lens

def resident_kib(kind):
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith(kind))

def found():
    corners, _ = CornerDetector(Filter(), Lens(640, 480, 500.0, 500.0, 319.5, 239.5), 1500).detect(image)
    return cv2.GaussianBlur(image, (5, 5), 0).tobytes(), corners.pixel.tobytes(), corners.appearance.tobytes()

image = np.random.default_rng(0).integers(0, 256, (480, 640), np.uint8)
before = found()
files_kib = resident_kib("RssFile")
leave_start()
print(resident_kib("RssFile") / files_kib)
assert found() == before
print(resident_kib("RssFile") / files_kib)
"""


def test_code_that_only_the_start_needed_is_let_go_and_what_is_used_comes_back() -> None:
    output = subprocess.run((sys.executable, "-c", LEAVE_START), check=True, capture_output=True, text=True).stdout
    left, used = map(float, output.split())
    assert left < 0.6
    assert used > left


MAPPING = """\
7f0000000000-7f0000100000 {rights} 00000000 08:01 1234 {of}
Size:               1024 kB
Rss:                 800 kB
Anonymous:         {written:5} kB
VmFlags: rd ex mr mw me
"""


def test_only_what_a_file_holds_is_let_go() -> None:
    library, heap = "                   /usr/lib/lib.so", ""
    kept = (
        ("rw-p", library, 0),
        ("r--s", library, 0),
        ("r--p", library, 4),
        ("r-xp", "      [vdso]", 0),
        ("r--p", heap, 0),
    )
    for rights, of, written in kept:
        others = MAPPING.format(rights="rw-p", of="   [heap]", written=0)
        assert list(as_in_files(MAPPING.format(rights=rights, of=of, written=written) + others)) == []
    for rights in ("r-xp", "r--p"):
        mapping = MAPPING.format(rights=rights, of=library, written=0)
        assert list(as_in_files(mapping)) == [(0x7F0000000000, 2**20)]
