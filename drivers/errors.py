"""What goes wrong with a device: one line that names it and what to do; ``retry``: trying again can help."""

from typing import ClassVar


class DriverError(Exception):
    """A device that cannot be used, or no longer; its text is the whole message."""

    retry: ClassVar[bool] = True


class DeviceMissingError(DriverError):
    """Nothing is there under that name or at that address; it may still be plugged in."""


class DeviceBusyError(DriverError):
    """Somebody else has it open."""


class DeviceForbiddenError(DriverError):
    """No permission; waiting does not bring it."""

    retry = False


class MissingSoftwareError(DriverError):
    """What runs the device is not installed on this computer."""

    retry = False


class DeviceLostError(DriverError):
    """It was there, and went away: unplugged, hung up, or its bus keeps failing."""


class DeviceStalledError(DriverError):
    """It is there, but nothing has come for longer than its rate allows."""


class WrongDeviceError(DriverError):
    """Something else answers: another chip, another protocol, another baud rate."""

    retry = False


class UnsupportedSettingError(DriverError):
    """The device does not grant a size, rate, format or range; the text says what it offers."""

    retry = False
