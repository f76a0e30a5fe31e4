"""The camera: present, permitted, free, with the requested settings, and delivering usable images."""

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from drivers.camera import offers
from drivers.camera.controls import EXPOSURE_UNIT_S
from drivers.camera.find import cameras, is_libcameras, open_camera_node
from drivers.camera.luminance import PIXEL_FORMATS
from drivers.camera.v4l2_ioctl import CID_EXPOSURE_ABSOLUTE, G_CTRL, Control, Node
from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceMissingError,
    DeviceStalledError,
    DriverError,
    MissingSoftwareError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from drivers.samples import Frame
from lcf_edge.config import Config
from lcf_edge.corners import own_parts
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.daemon.degrade import DARK
from lcf_edge.doctor import permissions
from lcf_edge.doctor.finding import Context, Finding, fail, ok, short, warn
from lcf_edge.doctor.health import daemon_having, of_device
from lcf_edge.doctor.measuring import Measured, measure
from lcf_edge.doctor.processes import in_use, processes
from lcf_edge.lens import Lens

SECONDS = 2.0
SETTLING_S = 1.0  # of the automatic exposure
BRIGHT = 230  # mean grey level of an image that is burnt out
FEW_CORNERS = 40
_SLOW = 0.9  # of the rate that was granted


def check(context: Context) -> Iterator[Finding]:
    """The configured camera."""
    camera = context.config.camera
    if camera.driver == "recording":
        yield from _recorded(context)
        return
    if camera.driver == "libcamera" or (camera.driver == "auto" and is_libcameras(camera.device, context.kernel)):
        yield from _through_libcamera(context)
        return
    try:
        node = open_camera_node(camera.device, context.kernel)
        path, card = Path(node.path), node.card
        node.close()
    except DriverError as error:
        yield _absent(context, error)
        return
    yield ok("camera", f"{camera.device}: {card}")
    daemon = daemon_having(context, "camera", path)
    if daemon is not None:
        yield of_device(context, "camera", daemon)
        return
    try:
        measured = measure(
            lambda: context.open_camera(context.config, context.clock), SECONDS, context.clock, SETTLING_S
        )
    except DriverError as error:
        yield _unusable(context, path, error)
        return
    yield from judged(context, measured, _exposure_s(context, path))


def _recorded(context: Context) -> Iterator[Finding]:
    name = context.config.camera.recording
    try:
        measured = measure(lambda: context.open_camera(context.config, context.clock), SECONDS, context.clock)
    except DriverError as error:
        yield fail("camera", short(error), f"{context.program} demo --out demo-out  # makes a recording")
        return
    yield ok("camera", f"the recording {name} stands in for it")
    yield from judged(context, measured)


def _through_libcamera(context: Context) -> Iterator[Finding]:
    device = context.config.camera.device
    try:
        measured = measure(
            lambda: context.open_camera(context.config, context.clock), SECONDS, context.clock, SETTLING_S
        )
    except DeviceBusyError as error:
        daemon = next((process for process in processes(context.proc) if process.is_daemon), None)
        if daemon is None:
            yield fail("camera", short(error), "sudo fuser -v /dev/media*")
        else:
            yield of_device(context, "camera", daemon)
    except MissingSoftwareError as error:
        yield fail("camera", short(error), "sudo apt install python3-libcamera libcamera-ipa")
    except DeviceForbiddenError as error:
        yield fail("camera", short(error), permissions.join("video"))
    except DriverError as error:
        yield fail("camera", str(error))
    else:
        yield ok("camera", f"{device}: through libcamera")
        yield from judged(context, measured)


def _absent(context: Context, error: DriverError) -> Finding:
    there = [(node.path, node.card) for node in cameras(context.kernel)]
    device = context.config.camera.device
    if isinstance(error, DeviceForbiddenError):
        owner = permissions.owner(context.dev / Path(device).name)
        whose = f" (it belongs to the {owner})" if owner else ""
        return fail("camera", f"{device}: this user may not open it{whose}", permissions.join("video"))
    if isinstance(error, DeviceMissingError | WrongDeviceError) and there:
        found = ", ".join(f"{path} ({card})" for path, card in there)
        remedy = context.again(f"camera.device={there[0][0]}")
        return fail("camera", f"{short(error)}; there is {found}", remedy)
    if isinstance(error, DeviceMissingError):
        text = f"{short(error)}, and no other, neither at USB nor at a ribbon cable"
        return fail("camera", text, "lsusb; sudo dmesg | grep -i csi  # does the kernel see it? docs/raspberry-pi.md")
    return fail("camera", str(error))


def _unusable(context: Context, path: Path, error: DriverError) -> Finding:
    if isinstance(error, DeviceBusyError):
        return in_use("camera", path, context.proc)
    if isinstance(error, UnsupportedSettingError):
        nearest = _nearest(context, path)
        return fail("camera", str(error), context.again(*nearest) if nearest else "")
    if isinstance(error, DeviceStalledError):
        return fail("camera", short(error), "sudo dmesg | tail  # cable, hub and power of the USB port")
    return fail("camera", str(error))


def _nearest(context: Context, path: Path) -> tuple[str, ...]:
    """Return settings with the closest size and rate on offer; empty: these are not the problem."""
    camera = context.config.camera
    with contextlib.suppress(OSError), contextlib.closing(Node(str(path), str(path), context.kernel)) as node:
        readable = [name for name in offers.formats(node) if name in PIXEL_FORMATS]
        if any(offers.grants(node, name, camera.width, camera.height, camera.fps) for name in readable):
            return () if camera.format == "auto" else ("camera.format=auto",)
        offered = [
            (abs(size.width * size.height - camera.width * camera.height), abs(rate.fastest - camera.fps), size, rate)
            for name in readable
            for size in offers.sizes(node, name)
            for rate in offers.rates(node, name, size.width, size.height)
        ]
        if offered:
            _, _, size, rate = min(offered, key=lambda one: one[:2])
            best = {"width": size.width, "height": size.height, "fps": round(rate.fastest, 3)}
            have = {"width": camera.width, "height": camera.height, "fps": camera.fps}
            return tuple(f"camera.{key}={value:g}" for key, value in best.items() if value != have[key])
    return ()


def judged(context: Context, measured: Measured[Frame], exposure_s: float | None = None) -> Iterator[Finding]:
    """Return findings about images; ``exposure_s``: as the camera reports it, None: unknown."""
    if not measured.records:
        yield fail("camera", f"{measured.name}: opens, but delivers no usable image ({_counts(measured)})")
        return
    yield _rate(context, measured, exposure_s)
    if measured.steps_back or measured.counts["stamped at arrival"]:
        yield warn("camera", f"stamps that cannot be true ({_counts(measured)}): replaced by the time of arrival")
    yield _light(measured.records[-1].image, context.config)


def _rate(context: Context, measured: Measured[Frame], exposure_s: float | None) -> Finding:
    camera = context.config.camera
    gap = "" if math.isnan(measured.longest_s) else f", longest gap {1e3 * measured.longest_s:.0f} ms"
    summary = f"{measured.summary()}{gap}"
    too_long = exposure_s is not None and exposure_s * camera.fps > 1
    if exposure_s is not None and not too_long:
        summary += f", exposure {1e3 * exposure_s:.1f} ms"
    lost = _counts(measured)
    summary += f"; {lost}" if lost else ""
    if camera.driver == "recording" or measured.rate_hz >= _SLOW * camera.fps:
        return ok("camera", summary)
    why = "as with cameras that expose longer in the dark"
    if exposure_s is not None and too_long:
        why = f"its exposure of {1e3 * exposure_s:.1f} ms is longer than a frame"
    return warn(
        "camera",
        f"{summary}: slower than camera.fps = {camera.fps:g}, {why}",
        context.again(f"camera.exposure_s={0.5 / camera.fps:.3g}"),
    )


def _light(image: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], config: Config) -> Finding:
    height, width = image.shape
    lens, visible = Lens.from_config(config.camera, width, height), own_parts.in_sight(config.camera, width, height)
    detector = CornerDetector(config.filter, lens, config.memory.corners, visible)
    corners, _ = detector.detect(image)
    grey, count = float(image.mean()), len(corners.pixel)
    summary = f"mean grey level {grey:.0f} of 255, {count} corners in an image"
    if grey < DARK:
        return warn("camera", f"dark: {summary}; take off the cap, add light, or use automatic exposure")
    if grey > BRIGHT:
        return warn("camera", f"overexposed: {summary}; shade it, or use automatic exposure")
    if count < FEW_CORNERS:
        return warn("camera", f"blind: {summary}; the lens is covered, out of focus, or facing something plain")
    return ok("camera", summary)


def _exposure_s(context: Context, path: Path) -> float | None:
    """Return the exposure that the camera reports; some report an old one with automatic exposure."""
    try:
        with contextlib.closing(Node(str(path), str(path), context.kernel)) as node:
            return float(node.ask(G_CTRL, Control(id=CID_EXPOSURE_ABSOLUTE)).value * EXPOSURE_UNIT_S)
    except OSError:
        return None


def _counts(measured: Measured[Frame]) -> str:
    return ", ".join(f"{what} {count}" for what, count in sorted(measured.counts.items()))
