"""One machine for all scenarios; what fails shows the journal."""

import os
import shutil
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest

from hil_mocks.vm.daemon import Daemon, Subscriber
from hil_mocks.vm.image import Image, ImageError, image, missing
from hil_mocks.vm.machine import Machine, MachineError

RESULTS = Path(os.environ.get("LCF_EDGE_HIL_RESULTS") or "hil-out")
WHERE_POSSIBLE = "LCF_EDGE_HIL_WHERE_POSSIBLE"
CAMERAS = "n_devs=2 node_types=0x1,0x101 num_inputs=1,1 input_types=0,3 num_outputs=1,1 output_types=0,1"

_IMAGE = pytest.StashKey[Image]()
_MACHINE = pytest.StashKey[Machine]()


def pytest_configure(config: pytest.Config) -> None:
    """Say in one line why there can be no machine."""
    if not config.option.collectonly and (reason := missing()):
        pytest.exit(f"hil: {reason}", 0 if os.environ.get(WHERE_POSSIBLE) else 1)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Make the image, which no scenario's time limit counts."""
    if session.items and not session.config.option.collectonly:
        try:
            session.config.stash[_IMAGE] = image()
        except ImageError as error:
            pytest.exit(f"hil: {error}", 1)


@pytest.fixture(scope="session")
def machine(pytestconfig: pytest.Config) -> Iterator[Machine]:
    """Booted once, with a webcam, an HDMI grabber behind an HDMI output, and an I2C bus with a chip at 0x28."""
    shutil.rmtree(RESULTS, ignore_errors=True)
    RESULTS.mkdir(parents=True)
    try:
        started = Machine(pytestconfig.stash[_IMAGE], RESULTS.resolve())
    except MachineError as error:
        if os.environ.get(WHERE_POSSIBLE):
            pytest.exit(f"hil: the machine does not start here, so nothing is shown: {error}", 0)
        raise
    with started as booted:
        booted.run(f"modprobe vivid {CAMERAS} && modprobe i2c-stub chip_addr=0x28 && udevadm settle")
        pytestconfig.stash[_MACHINE] = booted
        yield booted


@pytest.fixture(scope="session")
def subscriber(machine: Machine) -> Iterator[Subscriber]:
    """On the host, over the virtual network."""
    connected = Subscriber(machine.endpoint)
    yield connected
    connected.close()


@pytest.fixture(scope="session")
def daemon(machine: Machine, subscriber: Subscriber) -> Daemon:
    """The installed service."""
    return Daemon(machine, subscriber)


@pytest.fixture(autouse=True)
def begun_s(machine: Machine) -> float:
    """The machine's uptime when a scenario begins."""
    return machine.uptime_s()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A scenario that fails shows what was logged in the machine since it began."""
    report = yield
    machine = item.config.stash.get(_MACHINE, None)
    if report.failed and machine is not None:
        since_s = getattr(item, "funcargs", {}).get("begun_s", 0.0)
        try:
            logged = machine.journal(since_s)
        except MachineError as error:
            logged = str(error)
        report.sections.append(("journal of the machine", logged))
    return report
