"""Errors of devices: one line with the device, the fault and the fix; ``retry``: trying again can help."""

from typing import ClassVar


class DriverError(Exception):
    """A device cannot be used, or no longer; the text is the whole message."""

    retry: ClassVar[bool] = True


class DeviceMissingError(DriverError):
    """No device by that name or at that address; it may be plugged in later."""


class DeviceBusyError(DriverError):
    """Another program has it open."""


class DeviceForbiddenError(DriverError):
    """No permission; waiting does not help."""

    retry = False


class MissingSoftwareError(DriverError):
    """Software that the device needs is not installed on this computer."""

    retry = False


class DeviceLostError(DriverError):
    """It was there and went away: unplugged, hung, or its bus keeps failing."""


class DeviceStalledError(DriverError):
    """It is there, but has been silent for longer than its rate allows."""


class WrongDeviceError(DriverError):
    """Something else answers: another chip, protocol or baud rate."""

    retry = False


class UnsupportedSettingError(DriverError):
    """The device does not grant a size, rate, format or range; the text says what it offers."""

    retry = False
