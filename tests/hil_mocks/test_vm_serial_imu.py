"""The virtual machine's serial IMU as the end of a wire, which holds up nobody."""

import select
import socket
import time

from hil_mocks.vm.machine import Machine
from hil_mocks.vm.scenarios.test_imus import SerialImu

PATIENCE_S = 30.0
ECHOED = 2000  # bytes, each by itself: far more than a socket keeps


def test_a_machine_that_takes_no_line_can_still_send() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
        theirs.settimeout(PATIENCE_S)
        machine = object.__new__(Machine)
        machine.imu = ours
        imu = SerialImu(machine)
        imu.start()
        deadline_s = time.monotonic() + PATIENCE_S
        while select.select([], [ours], [], 0)[1]:
            assert time.monotonic() < deadline_s
            time.sleep(0.01)
        for _ in range(ECHOED):
            theirs.send(b"0")
        imu.ended.set()
        imu.join(PATIENCE_S)
        assert not imu.is_alive()
        assert theirs.recv(64).startswith(b"10000,")
