"""Exposure, gain and power-line frequency: set, read back, and refused where the camera does not apply them."""

import errno
from collections.abc import Callable
from contextlib import suppress

from drivers.camera.v4l2_errors import NOT_IMPLEMENTED
from drivers.camera.v4l2_ioctl import (
    CID_ANALOGUE_GAIN,
    CID_AUTOGAIN,
    CID_EXPOSURE_ABSOLUTE,
    CID_EXPOSURE_AUTO,
    CID_EXPOSURE_AUTO_PRIORITY,
    CID_GAIN,
    CID_POWER_LINE_FREQUENCY,
    CTRL_DISABLED,
    G_CTRL,
    QUERYCTRL,
    QUERYMENU,
    S_CTRL,
    Control,
    ControlQuery,
    MenuQuery,
    Node,
)
from drivers.errors import UnsupportedSettingError

EXPOSURE_UNIT_S = 1e-4
_AUTOMATIC, _MANUAL, _SHUTTER_FIRST, _APERTURE_FIRST = 0, 1, 2, 3  # CID_EXPOSURE_AUTO; 0 and 3: automatic time
_POWER_LINE = (0, 50, 60)  # Hz, by the control's value
_REFUSALS = (*NOT_IMPLEMENTED, errno.ERANGE, errno.EACCES, errno.EBUSY)  # errors of a value, not of the device


def set_exposure(node: Node, exposure_s: float | None) -> None:
    """Lock the exposure; None: the camera's automatic, without lowering its rate in the dark.

    Raises ``UnsupportedSettingError``, ``OSError``.
    """
    if exposure_s is not None:
        if _query(node, CID_EXPOSURE_AUTO):
            _set(node, "the exposure's lock", CID_EXPOSURE_AUTO, _MANUAL)
        _set(node, "camera.exposure_s", CID_EXPOSURE_ABSOLUTE, round(exposure_s / EXPOSURE_UNIT_S), _seconds)
        return
    if _query(node, CID_EXPOSURE_AUTO) and _get(node, CID_EXPOSURE_AUTO) in {_MANUAL, _SHUTTER_FIRST}:
        modes = [mode for mode in (_AUTOMATIC, _APERTURE_FIRST) if _in_menu(node, CID_EXPOSURE_AUTO, mode)]
        if modes:  # else it has no automatic exposure
            _set(node, "the exposure's automatic", CID_EXPOSURE_AUTO, modes[0])
    if _query(node, CID_EXPOSURE_AUTO_PRIORITY):
        with suppress(UnsupportedSettingError):  # some cameras list it without supporting it
            _set(node, "the rate's priority", CID_EXPOSURE_AUTO_PRIORITY, 0)


def set_gain(node: Node, gain: int | None) -> None:
    """Lock the gain, in the camera's own units; None: the camera's automatic.

    Raises ``UnsupportedSettingError``, ``OSError``.
    """
    automatic = _query(node, CID_AUTOGAIN) is not None
    if gain is None:
        if automatic:
            _set(node, "the gain's automatic", CID_AUTOGAIN, 1)
        return
    if automatic:
        _set(node, "the gain's lock", CID_AUTOGAIN, 0)
    _set(node, "camera.gain", CID_GAIN if _query(node, CID_GAIN) else CID_ANALOGUE_GAIN, gain)


def set_power_line(node: Node, power_line_hz: int | None) -> None:
    """Set the flicker filter: 50 or 60 Hz, 0: off; None: unchanged. Raises ``UnsupportedSettingError``, ``OSError``."""
    if power_line_hz is not None:
        _set(node, "camera.power_line_hz", CID_POWER_LINE_FREQUENCY, _POWER_LINE.index(power_line_hz), _power_line)


def _query(node: Node, control: int) -> ControlQuery | None:
    """Return the control's range; None: the camera lacks it."""
    try:
        query = node.ask(QUERYCTRL, ControlQuery(id=control))
    except OSError as error:
        if error.errno in NOT_IMPLEMENTED:
            return None
        raise
    return None if query.flags & CTRL_DISABLED else query


def _in_menu(node: Node, control: int, index: int) -> bool:
    try:
        node.ask(QUERYMENU, MenuQuery(id=control, index=index))
    except OSError as error:
        if error.errno in NOT_IMPLEMENTED:
            return False
        raise
    return True


def _get(node: Node, control: int) -> int:
    return int(node.ask(G_CTRL, Control(id=control)).value)


def _seconds(units: int) -> str:
    return f"{units * EXPOSURE_UNIT_S:g}"


def _power_line(index: int) -> str:
    return str(_POWER_LINE[index]) if index < len(_POWER_LINE) else "automatic"


def _set(node: Node, what: str, control: int, value: int, shown: Callable[[int], str] = str) -> None:
    """Set a control. ``what``: its key, or what it does; ``shown``: its value in the key's unit."""
    query = _query(node, control)
    if query is None:
        raise UnsupportedSettingError(f"{node.name}: {what} cannot be set; leave it unset")
    if not query.minimum <= value <= query.maximum:
        raise UnsupportedSettingError(
            f"{node.name}: {what} cannot be {shown(value)}; choose {shown(query.minimum)} to {shown(query.maximum)},"
            " or leave it unset"
        )
    try:
        node.ask(S_CTRL, Control(id=control, value=value))
        taken = _get(node, control)
    except OSError as error:
        if error.errno not in _REFUSALS:
            raise
        raise UnsupportedSettingError(
            f"{node.name}: {what} cannot be {shown(value)} ({error.strerror}); leave it unset"
        ) from error
    if abs(taken - value) >= max(query.step, 1):
        raise UnsupportedSettingError(
            f"{node.name}: {what} became {shown(taken)} instead of {shown(value)}; set {shown(taken)} or leave it unset"
        )
