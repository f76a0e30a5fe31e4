"""The kernel's structures and request numbers, as a C compiler lays them out on 64-bit Linux."""

import ctypes
import errno
import os
from pathlib import Path

import pytest

from drivers.camera import v4l2_ioctl as v4l2
from drivers.camera.v4l2_errors import driver_error
from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from tests.emulation import needs_the_processor

SIZES = {
    v4l2.Capability: 104,
    v4l2.FormatDescription: 64,
    v4l2.Format: 208,
    v4l2.FrameSize: 44,
    v4l2.FrameInterval: 52,
    v4l2.StreamParm: 204,
    v4l2.RequestBuffers: 20,
    v4l2.Buffer: 88,
    v4l2.PlanesBuffer: 88,
    v4l2.PlanesFormat: 208,
    v4l2.PlaneFormat: 20,
    v4l2.Plane: 64,
    v4l2.ControlQuery: 68,
    v4l2.MenuQuery: 44,
    v4l2.Control: 8,
    v4l2.BufferType: 4,
}
REQUESTS = {
    "QUERYCAP": 0x80685600,
    "ENUM_FMT": 0xC0405602,
    "S_FMT": 0xC0D05605,
    "REQBUFS": 0xC0145608,
    "QUERYBUF": 0xC0585609,
    "QBUF": 0xC058560F,
    "DQBUF": 0xC0585611,
    "STREAMON": 0x40045612,
    "STREAMOFF": 0x40045613,
    "S_PARM": 0xC0CC5616,
    "G_CTRL": 0xC008561B,
    "S_CTRL": 0xC008561C,
    "QUERYCTRL": 0xC0445624,
    "QUERYMENU": 0xC02C5625,
    "ENUM_FRAMESIZES": 0xC02C564A,
    "ENUM_FRAMEINTERVALS": 0xC034564B,
}
BUFFER_OFFSETS = {"flags": 12, "seconds": 24, "sequence": 56, "offset": 64, "length": 72}


@pytest.mark.parametrize(("structure", "size"), SIZES.items(), ids=lambda value: getattr(value, "__name__", ""))
def test_structures_have_the_kernels_size(structure: type[ctypes.Structure], size: int) -> None:
    assert ctypes.sizeof(structure) == size


@pytest.mark.parametrize(("name", "number"), REQUESTS.items())
def test_requests_have_the_kernels_numbers(name: str, number: int) -> None:
    assert getattr(v4l2, name) == number


def test_the_fields_of_a_buffer_lie_where_the_kernel_puts_them() -> None:
    assert {name: getattr(v4l2.Buffer, name).offset for name in BUFFER_OFFSETS} == BUFFER_OFFSETS
    assert v4l2.Format.width.offset == 8
    assert v4l2.PlanesFormat.planes.offset == 8 + 20
    assert v4l2.PlanesFormat.num_planes.offset == 8 + 180
    assert v4l2.PlanesBuffer.planes.offset == 64
    assert v4l2.PlanesBuffer.length.offset == 72
    assert (v4l2.Plane.offset.offset, v4l2.Plane.data_offset.offset) == (8, 16)
    assert v4l2.StreamParm.numerator.offset == 12


def test_a_pixel_format_is_its_letters_and_prints_whatever_it_holds() -> None:
    assert v4l2.fourcc("YUYV") == 0x56595559
    assert v4l2.fourcc_text(0x56595559) == "YUYV"
    assert v4l2.fourcc_text(v4l2.fourcc("Y10")) == "Y10"
    assert v4l2.fourcc("Y10") == 0x20303159
    assert v4l2.fourcc_text(0x00FF0A20) == " ???"


def test_a_cards_name_is_printable_text() -> None:
    capability = v4l2.Capability()
    name = b"Cam\x1b\xff e\0rubbish"
    capability.card[: len(name)] = name
    assert v4l2.text(capability.card) == "Cam?\ufffd e"


@pytest.mark.parametrize(
    ("number", "kind", "remedy"),
    [
        (errno.ENOENT, DeviceMissingError, "plug it in"),
        (errno.ENODEV, DeviceLostError, "plug it in again"),
        (errno.EBUSY, DeviceBusyError, "fuser"),
        (errno.EACCES, DeviceForbiddenError, "group video"),
        (errno.ENOTTY, WrongDeviceError, "/dev/v4l/by-id"),
        (errno.ENOSPC, UnsupportedSettingError, "bandwidth"),
        (errno.EIO, DeviceLostError, "cable"),
    ],
)
def test_the_kernels_error_numbers_are_reported_with_a_remedy(number: int, kind: type, remedy: str) -> None:
    error = driver_error("/dev/video7", OSError(number, os.strerror(number)))
    assert type(error) is kind
    assert str(error).startswith("/dev/video7: ")
    assert remedy in str(error)


class TestLinuxKernel:
    """The real system calls, on files that every Linux has."""

    @needs_the_processor("the emulator itself does not know the request")
    def test_a_request_that_a_file_does_not_know_is_an_error(self) -> None:
        fd = v4l2.LINUX.open("/dev/null")
        with pytest.raises(OSError, match="ioctl") as caught:
            v4l2.LINUX.ioctl(fd, v4l2.QUERYCAP, v4l2.Capability())
        v4l2.LINUX.close(fd)
        assert caught.value.errno == errno.ENOTTY

    def test_waiting_ends_with_the_timeout_or_the_event(self) -> None:
        reading, writing = os.pipe()
        assert v4l2.LINUX.poll(reading, 0.0) == 0
        os.close(writing)
        assert v4l2.LINUX.poll(reading, 10.0) != 0
        os.close(reading)

    def test_nodes_come_in_the_order_of_their_numbers(self) -> None:
        numbers = [int(Path(path).name.removeprefix("video")) for path in v4l2.LINUX.nodes()]
        assert numbers == sorted(numbers)
