"""Find a camera's node by path, by a link that survives a replug (/dev/v4l/by-id/…), or by the camera's name."""

import contextlib
import errno
from collections.abc import Iterator

from drivers.camera.v4l2_errors import NEEDS_LIBCAMERA, driver_error
from drivers.camera.v4l2_ioctl import LINUX, Kernel, Node
from drivers.errors import DeviceMissingError, WrongDeviceError


def open_camera_node(device: str, kernel: Kernel = LINUX) -> Node:
    """Open the capture node of ``device``: a path, or a name such as "HD Pro Webcam C920".

    A name may be part of the camera's, in any case; full names take precedence. Raises ``DriverError``, among them
    ``DeviceMissingError``, which lists the cameras present, and ``WrongDeviceError`` for a node that delivers no
    images, or only through libcamera, and for an ambiguous name.
    """
    return _by_path(device, kernel) if "/" in device else _by_name(device, kernel)


def is_libcameras(device: str, kernel: Kernel = LINUX) -> bool:
    """Whether ``device`` is a camera that only libcamera can run.

    That is a node of a pipeline, or, if a sensor has such a node, a name that no V4L2 camera has.
    """
    is_path = device.startswith("/dev/")
    cards, through_libcamera = [], False
    for path in [device] if is_path else kernel.nodes():
        with contextlib.suppress(OSError), contextlib.closing(Node(path, path, kernel)) as node:
            through_libcamera |= node.needs_libcamera and (is_path or not node.is_signal_processor)
            cards += [node.card.casefold()] * node.is_camera
    return through_libcamera and not any(device.casefold() in card for card in cards)


def cameras(kernel: Kernel = LINUX) -> Iterator[Node]:
    """Yield all capture nodes that can be opened, each open until the next is requested."""
    for path in kernel.nodes():
        with contextlib.suppress(OSError), contextlib.closing(Node(path, path, kernel)) as node:
            if node.is_camera:
                yield node


def _by_path(path: str, kernel: Kernel) -> Node:
    try:
        node = Node(path, path, kernel)
    except OSError as error:
        if error.errno in {errno.ENOENT, errno.ENODEV, errno.ENXIO}:
            raise DeviceMissingError(f"{path}: no such camera; {_found(kernel)}") from error
        raise driver_error(path, error) from error
    if node.is_camera:
        return node
    node.close()
    if node.needs_libcamera:
        raise WrongDeviceError(f"{path}: {NEEDS_LIBCAMERA}; {_found(kernel)}")
    raise WrongDeviceError(f"{path}: gives no images (metadata, output or radio); {_found(kernel)}")


def _by_name(name: str, kernel: Kernel) -> Node:
    cards: dict[str, str] = {}
    through_libcamera: set[str] = set()  # names
    refused: OSError | None = None
    for path in kernel.nodes():
        try:
            with contextlib.closing(Node(path, path, kernel)) as node:
                if node.is_camera:
                    cards[path] = node.card.casefold()
                elif node.needs_libcamera:
                    through_libcamera.add(node.card.casefold())
        except OSError as error:
            refused = error
    card_or_name = name.casefold()
    whole = [path for path, card in cards.items() if card == card_or_name]
    paths = whole or [path for path, card in cards.items() if card_or_name in card]
    if not paths:
        if refused is not None and refused.errno in {errno.EACCES, errno.EPERM}:
            raise driver_error(name, refused) from refused
        if any(card_or_name in card for card in through_libcamera):
            raise WrongDeviceError(f"{name}: {NEEDS_LIBCAMERA}; {_found(kernel)}")
        raise DeviceMissingError(f"{name}: no camera has this name; {_found(kernel)}")
    if len(paths) > 1:
        raise WrongDeviceError(f"{name}: {' and '.join(paths)} have this name; choose one by /dev/v4l/by-id/…")
    try:
        return Node(paths[0], name, kernel)
    except OSError as error:
        raise driver_error(name, error) from error


def _found(kernel: Kernel) -> str:
    found = ", ".join(f"{node.path} ({node.card})" for node in cameras(kernel))
    return f"found: {found}" if found else "no other camera is plugged in"
