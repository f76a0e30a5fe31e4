"""What goes wrong with a device: one line that names it and what to do; ``retry``: trying again can help."""

from typing import ClassVar


class DriverError(Exception):
    """A device that cannot be used, or no longer; its text is the whole message."""

    retry: ClassVar[bool] = True


class DeviceMissingError(DriverError):
    """Nothing there by that name or at that address; it may still be plugged in."""


class DeviceBusyError(DriverError):
    """Another program has it open."""


class DeviceForbiddenError(DriverError):
    """No permission; waiting does not help."""

    retry = False


class MissingSoftwareError(DriverError):
    """Software that the device needs is not installed on this computer."""

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
