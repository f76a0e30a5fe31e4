"""The targets of a siege: processes, each with its log, descriptors and memory; and the certificates of a planner."""

import json
import os
import shlex
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from lcf_edge.errors import LcfError
from lcf_edge.zenoh_link.admission import access_control

MIB = 2**20
_KEY = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -noenc -days 2"
_PARTY = "-addext basicConstraints=critical,CA:FALSE -addext subjectAltName=DNS:localhost"


DAEMON_NICE = -10
"""As in its unit; who may not raise a priority leaves it."""


class Process:
    """``lcf-edge`` with a command, its output in ``log``; the daemon at the priority of its unit."""

    def __init__(self, name: str, folder: Path, *arguments: str) -> None:
        self.name = name
        self.log = folder / f"{name}.log"
        with self.log.open("wb") as log:
            self._process = subprocess.Popen(
                (sys.executable, "-m", "lcf_edge", *arguments), stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )
        self.pid = self._process.pid
        if name == "daemon":
            with suppress(PermissionError):
                os.setpriority(os.PRIO_PROCESS, self.pid, DAEMON_NICE)

    @property
    def status(self) -> int | None:
        """Its exit status; None: it runs."""
        return self._process.poll()

    @property
    def descriptors(self) -> int:
        """Number of open descriptors."""
        return len(list(Path(f"/proc/{self.pid}/fd").iterdir()))

    @property
    def resident_mib(self) -> float:
        """Resident memory, MiB."""
        pages = int(Path(f"/proc/{self.pid}/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / MIB

    @property
    def said(self) -> list[str]:
        """Its log lines so far."""
        return self.log.read_text(encoding="utf-8", errors="replace").splitlines()

    def end(self) -> int:
        """Terminate it; returns its exit status, -9 if it had to be killed."""
        self._process.terminate()
        try:
            return self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()


def certificates(folder: Path) -> None:
    """As docs/network.md says, of a rover and a planner. Raises ``LcfError`` without openssl."""
    (folder / "inner").mkdir(parents=True)
    for command in (
        f"{_KEY} -subj /CN=authority -keyout ca.key -out ca.pem",
        f"{_KEY} -subj /CN=inner-authority -keyout inner-ca.key -out inner-ca.pem",
        f"{_KEY} {_PARTY} -CA ca.pem -CAkey ca.key -subj /CN=rover -keyout rover.key -out rover.pem",
        f"{_KEY} {_PARTY} -CA ca.pem -CAkey ca.key -subj /CN=planner -keyout planner.key -out planner.pem",
        f"{_KEY} {_PARTY} -CA inner-ca.pem -CAkey inner-ca.key -subj /CN=planner"
        " -keyout inner/planner.key -out inner/planner.pem",
    ):
        try:
            subprocess.run(shlex.split(command), cwd=folder, check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise LcfError(f"siege: openssl is needed for certificates: {error}") from error


def rover_settings(folder: Path, prefix: str = "lcf") -> Path:
    """Zenoh's file of the daemon: TLS for the gate, rules for everybody."""
    tls = {
        "root_ca_certificate": str(folder / "inner-ca.pem"),
        "listen_certificate": str(folder / "rover.pem"),
        "listen_private_key": str(folder / "rover.key"),
        "enable_mtls": True,
    }
    return _written(
        folder / "zenoh.json5", {"transport": {"link": {"tls": tls}}, "access_control": access_control(prefix)}
    )


def planner_settings(folder: Path) -> Path:
    """Zenoh's file of a planner."""
    tls = {
        "root_ca_certificate": str(folder / "ca.pem"),
        "connect_certificate": str(folder / "planner.pem"),
        "connect_private_key": str(folder / "planner.key"),
        "enable_mtls": True,
    }
    return _written(folder / "planner.json5", {"transport": {"link": {"tls": tls}}})


def _written(file: Path, settings: dict[str, object]) -> Path:
    file.write_text(json.dumps(settings), encoding="utf-8")
    return file
