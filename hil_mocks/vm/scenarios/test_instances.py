"""Two cameras on one computer, each with its instance of the unit, as in docs/several-cameras.md."""

from collections.abc import Iterator

import pytest

from hil_mocks.vm.daemon import PATIENCE_S, UNIT, WEBCAM
from hil_mocks.vm.machine import Machine

NAMES = {"front": 7447, "rear": 7448}
FOUND = """from lcf_edge.client import scenes
for number, scene in zip(range(5), scenes("tcp/127.0.0.1:{port}", "lcf/{name}/scene")):
    print(scene.image_width)
"""


def configuration(name: str, device: str) -> str:
    camera = WEBCAM.replace("/dev/video0", device)
    return (
        f'{camera}\n[zenoh]\nlisten = ["tcp/127.0.0.1:{NAMES[name]}"]\n\n[publish]\nprefix = "lcf/{name}"\n'
        f'frame_id = "camera_{name}"\nrobot = "rover-{name}"\n\n'
        f'[record]\nwhen = "always"\nfolder = "/var/lib/lcf-edge-{name}"\n'
    )


def shown(machine: Machine, name: str, what: str) -> str:
    return machine.run(f"systemctl show lcf-edge@{name} --property={what} --value")


@pytest.fixture(scope="module")
def both(machine: Machine) -> Iterator[Machine]:
    """Both run; the plain unit does not."""
    machine.run(f"systemctl stop {UNIT}")
    (multi,) = machine.run(
        "for one in /sys/class/video4linux/*; do grep -q vivid-002-vid-cap $one/name && basename $one; done; true"
    ).split()
    for name, device in (("front", "/dev/video0"), ("rear", f"/dev/{multi}")):
        (machine.share / f"{name}.toml").write_text(configuration(name, device), encoding="utf-8")
        machine.run(f"install -m 644 /mnt/{name}.toml /etc/lcf-edge/")
    machine.run("systemctl start lcf-edge@front lcf-edge@rear", 2 * PATIENCE_S)
    yield machine
    machine.run("systemctl stop 'lcf-edge@*'; rm /etc/lcf-edge/front.toml /etc/lcf-edge/rear.toml")


def test_each_sends_its_own_scenes_at_its_own_port(both: Machine) -> None:
    for name, port in NAMES.items():
        (both.share / "found.py").write_text(FOUND.format(port=port, name=name), encoding="utf-8")
        sent = both.run("/opt/lcf-edge/bin/python -P /mnt/found.py", PATIENCE_S).split()
        assert len(sent) == 5


def test_each_has_a_user_and_a_folder_of_its_own(both: Machine) -> None:
    users = {name: both.run(f"stat -c %u /proc/{shown(both, name, 'MainPID')}") for name in NAMES}
    assert len(set(users.values())) == len(NAMES)
    for name in NAMES:
        both.wait_until(f"ls /var/lib/lcf-edge-{name}/*.mcap*")
        # As it sees them itself: from Debian 13 on, they are nobody's for the others.
        inside = f"nsenter --target {shown(both, name, 'MainPID')} --mount sh -c"
        folder = f"/var/lib/lcf-edge-{name}"
        owners = both.run(f"{inside} 'stat -L -c %u {folder} {folder}/*.mcap*'").split()
        assert set(owners) == {users[name]}


def test_one_cannot_see_what_the_other_keeps(both: Machine) -> None:
    inside = f"nsenter --target {shown(both, 'front', 'MainPID')} --mount ls /var/lib/lcf-edge-front /var/lib/private"
    assert "lcf-edge-rear" not in both.tried(inside).output


def test_one_that_is_killed_comes_back_and_the_other_runs_on(both: Machine) -> None:
    rear = shown(both, "rear", "MainPID")
    both.run(f"kill -KILL {shown(both, 'front', 'MainPID')}")
    both.wait_until(
        "test $(systemctl show lcf-edge@front --property=NRestarts --value) -gt 0"
        " -a $(systemctl show lcf-edge@front --property=ActiveState --value) = active",
        PATIENCE_S,
    )
    assert shown(both, "rear", "MainPID") == rear


def test_doctor_looks_at_the_instance_and_its_neighbour(both: Machine) -> None:
    output = both.tried("lcf-edge doctor -c /etc/lcf-edge/front.toml", PATIENCE_S).output
    assert "lcf-edge@front and lcf-edge@rear do not conflict" in output
    assert "sudo systemctl enable lcf-edge@front" in output
    same = "lcf-edge doctor -c /etc/lcf-edge/front.toml --set publish.prefix=lcf/rear"
    assert "both have publish.prefix = lcf/rear" in both.tried(same, PATIENCE_S).output
