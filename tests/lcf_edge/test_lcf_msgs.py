"""The ROS 2 package has the messages that go out, and says what it needs to be built."""

import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

from lcf_edge import __version__
from lcf_edge.zenoh_link.schema import scene_schema

ROOT = Path(__file__).parents[2]
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
OURS, PACKAGE = ROOT / "lcf_edge" / "msg", ROOT / "ros2" / "lcf_msgs"
MESSAGES = {path.name: path.read_bytes() for path in OURS.glob("*.msg")}


def test_the_messages_are_the_same() -> None:
    assert MESSAGES
    assert {path.name: path.read_bytes() for path in (PACKAGE / "msg").iterdir()} == MESSAGES


def test_every_message_is_generated() -> None:
    cmake = (PACKAGE / "CMakeLists.txt").read_text(encoding="utf-8")
    assert set(re.findall(r'"msg/(\w+\.msg)"', cmake)) == set(MESSAGES)
    found = set(re.findall(r"find_package\((\w+) REQUIRED\)", cmake))
    assert found == {"ament_cmake", "rosidl_default_generators", "std_msgs"}


def test_the_package_names_what_it_depends_on() -> None:
    package = ET.parse(PACKAGE / "package.xml").getroot()
    assert package.findtext("name") == "lcf_msgs"
    assert package.findtext("version") == __version__
    assert package.findtext("license") == "Apache-2.0"
    used = {name for text in MESSAGES.values() for name in re.findall(r"^(\w+)/\w+ ", text.decode(), re.MULTILINE)}
    assert {element.text for element in package.iter("depend")} == used
    assert package.findtext("member_of_group") == "rosidl_interface_packages"


def test_the_published_schema_is_made_of_the_same_messages() -> None:
    schema = scene_schema()
    assert all(text.decode() in schema for text in MESSAGES.values())


def test_classes_can_be_made_of_what_a_daemon_sends_without_ros_and_without_this_package(rover: Any) -> None:
    code = (ROOT / "examples/without_lcf_msgs.py").read_text(encoding="utf-8")
    assert not re.search(r"(import|from) lcf_edge", code)
    assert DEFAULT_ENDPOINT in code
    command = (sys.executable, "-u", "-c", code.replace(DEFAULT_ENDPOINT, rover.endpoint))
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as subscriber:
        try:
            assert subscriber.stdout
            line = subscriber.stdout.readline()
        finally:
            subscriber.kill()
    assert re.fullmatch(r"\d+: class 1, contact in 0\.8 ± 0\.1 s\n", line)
