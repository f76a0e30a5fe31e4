"""Whoever uses up the descriptors: some stay in reserve for devices and files, and the shortage is reported."""

import os
import subprocess
import sys

# In a process of its own, so that the shortage is its own.
SHORT = """
import os, resource
from lcf_edge.daemon.descriptors import LENT, RESERVED, Reserve
from lcf_edge.daemon.memory import ResidentMemory

def held():
    return len(os.listdir("/proc/self/fd"))

resource.setrlimit(resource.RLIMIT_NOFILE, (100, 100))
others = held()  # also of libraries: a newer libffi keeps its own file open
reserve, resident_mib = Reserve(), ResidentMemory()
reserve.check()
assert not reserve.short
taken = []
try:
    while True:
        taken.append(os.open(os.devnull, os.O_RDONLY))
except OSError:
    pass
for _ in range(3):
    reserve.check()
assert reserve.short and reserve.shortages == 1
assert resident_mib() > 1
with reserve.lent():
    mine = [os.open(os.devnull, os.O_RDONLY) for _ in range(LENT)]
for number in mine:
    os.close(number)
for number in taken:
    os.close(number)
reserve.check()
assert not reserve.short
with reserve.lent(), reserve.lent():
    mine = [os.open(os.devnull, os.O_RDONLY) for _ in range(2 * LENT)]
reserve.close()
assert held() == others + len(mine) + 1  # and what measures the memory
"""


def test_what_is_reserved_can_be_opened_when_all_others_are_used_up() -> None:
    done = subprocess.run((sys.executable, "-c", SHORT), check=False, capture_output=True, text=True, env=os.environ)
    assert done.returncode == 0, done.stderr
