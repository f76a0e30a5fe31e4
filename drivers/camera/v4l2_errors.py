"""What the kernel's error numbers mean to the user of a camera."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager

from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    DriverError,
    UnsupportedSettingError,
    WrongDeviceError,
)

NEEDS_LIBCAMERA = (
    'gives images only through libcamera, as ribbon-cable cameras do; set camera.driver = "libcamera"'
    " (docs/raspberry-pi.md)"
)
NOT_SET_UP = (errno.EINVAL, errno.EPIPE, errno.ENOLINK)  # of STREAMON: the pipeline's formats or links are not set up
NOT_IMPLEMENTED = (errno.EINVAL, errno.ENOTTY)  # for requests that a driver does not implement


_MEANINGS: dict[int, tuple[type[DriverError], str]] = {
    errno.ENOENT: (DeviceMissingError, "no such camera; plug it in, or name another one"),
    errno.ENODEV: (DeviceLostError, "unplugged; plug it in again"),
    errno.ENXIO: (DeviceLostError, "unplugged; plug it in again"),
    errno.EBUSY: (DeviceBusyError, "in use by another program; close that (fuser -v /dev/video* names it)"),
    errno.EACCES: (DeviceForbiddenError, "no permission; add this user to the group video and log in again"),
    errno.EPERM: (DeviceForbiddenError, "no permission; add this user to the group video and log in again"),
    errno.ENOTTY: (WrongDeviceError, "not a video device; name one of /dev/video* or /dev/v4l/by-id/*"),
    errno.EISDIR: (WrongDeviceError, "not a video device; name one of /dev/video* or /dev/v4l/by-id/*"),
    errno.ENOSPC: (
        UnsupportedSettingError,
        "its USB bus has not enough bandwidth left; choose MJPG, a smaller size or rate, or another port",
    ),
}


def driver_error(name: str, error: OSError) -> DriverError:
    """Return the typed error, with its fix, for ``error`` of the camera ``name``."""
    known = _MEANINGS.get(error.errno or 0)
    if known is None:
        return DeviceLostError(f"{name}: fails ({error.strerror}); check cable and power")
    kind, text = known
    return kind(f"{name}: {text}")


@contextmanager
def started(name: str) -> Iterator[None]:
    """Raise ``WrongDeviceError`` where a configured node does not start, as it is part of a pipeline."""
    try:
        yield
    except OSError as error:
        if error.errno not in NOT_SET_UP:
            raise
        text = f"does not start on its own ({error.strerror}); most likely it {NEEDS_LIBCAMERA}"
        raise WrongDeviceError(f"{name}: {text}") from error


@contextmanager
def as_driver_errors(name: str) -> Iterator[None]:
    """Turn ``OSError`` into ``DriverError``."""
    try:
        yield
    except OSError as error:
        raise driver_error(name, error) from error
