"""Pixel formats as the kernel's vivid lays them out, in one memory for an image and in one for each plane."""

import pytest

from hil_mocks.vm.daemon import Daemon
from hil_mocks.vm.machine import Machine
from hil_mocks.vm.scenarios.test_frames import node

PATTERN = 20  # of vivid's: a slope of grey
FORMATS = "/opt/lcf-edge/bin/python -m hil_mocks.vm.guest.formats"
EVERYWHERE = {"NV12", "YU12", "YUYV", "UYVY", "Y10", "Y12", "Y16", "BGR3", "XR24", "BA81", "RG10", "BA12"}


@pytest.mark.parametrize(
    ("name", "least"),
    [("vivid-000-vid-cap", EVERYWHERE), ("vivid-002-vid-cap", EVERYWHERE | {"NM12", "YM12", "NM16"})],
    ids=["single-planar", "multi-planar"],
)
def test_all_formats_of_a_camera_show_the_same_image(
    machine: Machine, daemon: Daemon, name: str, least: set[str]
) -> None:
    daemon.stop()
    device = node(machine, name)
    machine.run(f"v4l2-ctl --device {device} --set-ctrl osd_text_mode=2,test_pattern={PATTERN}")
    differences = dict(line.split() for line in machine.run(f"{FORMATS} {device} 320 180", 300.0).splitlines())
    machine.run(f"v4l2-ctl --device {device} --set-ctrl osd_text_mode=0,test_pattern=0")
    assert least <= set(differences)
    assert {name: difference for name, difference in differences.items() if float(difference) > 1.5} == {}
