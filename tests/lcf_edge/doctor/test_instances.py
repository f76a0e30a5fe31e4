"""Several units on one computer: which one a configuration belongs to, and what two of them cannot share."""

from collections.abc import Callable
from pathlib import Path

import pytest

from lcf_edge.config import Camera, Config, Imu, Metrics, Publish, Record, Zenoh
from lcf_edge.doctor import instances
from lcf_edge.doctor.finding import Context, Severity
from lcf_edge.doctor.service import unit_of

Machine = Callable[..., Context]
FRONT = Config(
    camera=Camera(device="/dev/video0"),
    zenoh=Zenoh(listen=["tcp/127.0.0.1:7447"]),
    publish=Publish(prefix="lcf/front", frame_id="front", robot="rover-front"),
)
REAR = """[camera]
device = "/dev/video2"
[zenoh]
listen = ["tcp/127.0.0.1:7448"]
[publish]
prefix = "lcf/rear"
frame_id = "rear"
robot = "rover-rear"
"""


@pytest.fixture
def front(tmp_path: Path, machine: Machine) -> Callable[[str, str], Context]:
    """The context of front.toml; of rear.toml, its text and how systemd sees its unit."""

    def build(rear: str, state: str) -> Context:
        installed = tmp_path / "installed"
        installed.mkdir(exist_ok=True)
        (installed / "rear.toml").write_text(rear)
        systemctl = tmp_path / "systemctl"
        systemctl.write_text(f'#!/bin/sh\n[ "$2" = lcf-edge@rear.service ] && echo {state}\n')
        systemctl.chmod(0o755)
        return machine(FRONT, path=installed / "front.toml", systemctl=(str(systemctl),))

    return build


@pytest.mark.parametrize(
    ("path", "unit"),
    [
        ("/etc/lcf-edge/config.toml", "lcf-edge"),
        ("/etc/lcf-edge/front.toml", "lcf-edge@front"),
        ("/etc/lcf-edge/zenoh.json5", "lcf-edge"),
        ("/home/me/front.toml", "lcf-edge"),
        ("front.toml", "lcf-edge"),
    ],
)
def test_a_configuration_belongs_to_the_instance_of_its_name_where_those_of_units_are(path: str, unit: str) -> None:
    assert unit_of(Path(path), Path("/etc/lcf-edge")) == unit


def test_two_that_share_nothing_are_reported(front: Callable[[str, str], Context]) -> None:
    (found,) = instances.check(front(REAR, "UnitFileState=enabled"))
    assert (found.level, found.text) == (Severity.OK, "lcf-edge@front and lcf-edge@rear do not conflict")


def test_two_with_the_same_port_and_prefix_fail_with_the_file_to_edit(front: Callable[[str, str], Context]) -> None:
    same = REAR.replace("7448", "7447").replace("lcf/rear", "lcf/front")
    (found,) = instances.check(front(same, "ActiveState=active"))
    assert found.level is Severity.FAIL
    assert found.text == (
        "lcf-edge@front and lcf-edge@rear both have zenoh.listen = tcp/127.0.0.1:7447, publish.prefix = lcf/front"
    )
    assert found.remedy.endswith("front.toml")


@pytest.mark.parametrize("state", ["UnitFileState=disabled", "ActiveState=inactive"])
def test_a_file_whose_unit_neither_runs_nor_starts_at_boot_is_nobodys(
    front: Callable[[str, str], Context], state: str
) -> None:
    assert list(instances.check(front("", state))) == []


def test_a_file_that_cannot_be_used_is_left_to_its_own_examination(front: Callable[[str, str], Context]) -> None:
    assert list(instances.check(front("nonsense = 1", "ActiveState=active"))) == []


def test_a_file_of_a_developer_has_no_others_beside_it(machine: Machine, tmp_path: Path) -> None:
    assert list(instances.check(machine(FRONT, path=tmp_path / "front.toml"))) == []


@pytest.mark.parametrize(
    ("same", "collision"),
    [
        (Config(camera=Camera(device="/dev/video7")), "camera.device = /dev/video7"),
        (Config(imu=Imu(driver="csv", port="/dev/ttyUSB3")), "imu.port = /dev/ttyUSB3"),
        (Config(imu=Imu(driver="mpu6050", bus=3)), "imu.bus and address = 3, mpu6050"),
        (Config(imu=Imu(driver="bmi160", bus=3, address=0x69)), "imu.bus and address = 3, 0x69"),
        (Config(imu=Imu(driver="iio")), "imu.device = the first"),
        (Config(record=Record(when="always", folder="/var/lib/drives/")), "record.folder = /var/lib/drives"),
        (Config(metrics=Metrics(port=9447)), "metrics.port = 9447"),
        (Config(metrics=Metrics(textfile="/run/a.prom")), "metrics.textfile = /run/a.prom"),
    ],
)
def test_what_only_one_can_have_is_named_with_its_value(same: Config, collision: str) -> None:
    assert collision in instances.collisions(same, same)


def test_what_is_not_in_use_collides_with_nothing() -> None:
    unused = instances.collisions(Config(), Config())
    assert [key.partition(" ")[0] for key in unused] == [
        "zenoh.listen",
        "publish.prefix",
        "publish.frame_id",
        "publish.robot",
        "camera.device",
    ]
