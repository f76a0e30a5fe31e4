"""One machine for all scenarios, but for those whose module has ``SYSTEMS`` of its own; failures show the journal."""

import os
import shutil
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hil_mocks.vm.daemon import UNIT, Daemon, Subscriber
from hil_mocks.vm.image import DEBIAN_12, DEBIAN_13_ON_ARM, HERE, Image, ImageError, System, image, missing
from hil_mocks.vm.machine import Machine, MachineError

RESULTS = Path(os.environ.get("LCF_EDGE_HIL_RESULTS") or "hil-out")
WHERE_POSSIBLE = "LCF_EDGE_HIL_WHERE_POSSIBLE"
CAMERAS = (
    "n_devs=3 node_types=0x1,0x101,0x1 num_inputs=1,1,1 input_types=0,3,0 num_outputs=1,1,1 output_types=0,1,0"
    " multiplanar=1,1,2"
)

PROCESSORS = {"amd64": HERE, "arm64": DEBIAN_13_ON_ARM.processor}

PATIENT = "[Service]\\nWatchdogSec=60\\nTimeoutStartSec=300\\n"
"""What the units get where the processor is emulated: a busy host may give it no time for longer than they wait."""

_IMAGES = pytest.StashKey[dict[System, Image]]()
_MACHINE = pytest.StashKey[Machine]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """For which processor."""
    parser.addoption("--arch", choices=sorted(PROCESSORS), default="amd64", help="the machine's processor")


def pytest_configure(config: pytest.Config) -> None:
    """Say in one line why there can be no machine."""
    if not config.option.collectonly and (reason := missing(PROCESSORS[config.option.arch])):
        pytest.exit(f"hil: {reason}", 0 if os.environ.get(WHERE_POSSIBLE) else 1)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Make the images, which no scenario's time limit counts."""
    if session.config.option.collectonly:
        return
    systems = {_for_arch(session.config, system) for item in session.items for system in _systems(item)}
    try:
        session.config.stash[_IMAGES] = {system: image(system) for system in systems}
    except ImageError as error:
        pytest.exit(f"hil: {error}", 1)


def _systems(item: pytest.Item) -> tuple[System, ...]:
    """What a scenario may boot: its parameter, else what its module says."""
    parameters: dict[str, object] = getattr(getattr(item, "callspec", None), "params", {})
    chosen = parameters.get("machine")
    if isinstance(chosen, System):
        return (chosen,)
    module = item.getparent(pytest.Module)
    return getattr(module and module.obj, "SYSTEMS", (DEBIAN_12,))


def _for_arch(config: pytest.Config, system: System) -> System:
    """The system of a scenario; on 64-bit Arm there is one for all of them."""
    return system if PROCESSORS[config.option.arch] == system.processor else DEBIAN_13_ON_ARM


@contextmanager
def booted(config: pytest.Config, system: System, folder: Path) -> Iterator[Machine]:
    """A machine with that system, which leaves its console and journal in ``folder``."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with Machine(config.stash[_IMAGES][_for_arch(config, system)], folder.resolve()) as machine:
        if machine.emulated:
            for unit in ("lcf-edge", "lcf-edge@"):
                drop_in = f"/run/systemd/system/{unit}.service.d"
                machine.run(f"mkdir -p {drop_in} && printf '{PATIENT}' > {drop_in}/patient.conf")
            machine.run("systemctl daemon-reload")
        yield machine


@pytest.fixture(scope="session")
def machine(pytestconfig: pytest.Config) -> Iterator[Machine]:
    """Booted once: a webcam, an HDMI grabber behind an output, a multi-planar camera, an I2C bus, a chip at 0x28."""
    with booted(pytestconfig, DEBIAN_12, RESULTS) as running:
        running.run(f"modprobe vivid {CAMERAS} && modprobe i2c-stub chip_addr=0x28 && udevadm settle")
        yield running


@pytest.fixture(scope="module")
def subscriber(machine: Machine) -> Iterator[Subscriber]:
    """On the host, over the virtual network."""
    connected = Subscriber(machine.endpoint, machine.patience)
    yield connected
    connected.close()


@pytest.fixture(scope="module")
def daemon(machine: Machine, subscriber: Subscriber) -> Iterator[Daemon]:
    """The installed service, which leaves the processor to the machines of other modules."""
    yield Daemon(machine, subscriber)
    machine.tried(f"systemctl stop {UNIT}")  # a module may have removed it


@pytest.fixture(autouse=True)
def begun_s(machine: Machine, pytestconfig: pytest.Config) -> float:
    """The machine's uptime when a scenario begins."""
    pytestconfig.stash[_MACHINE] = machine
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
