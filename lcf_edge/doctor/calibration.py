"""What the filter must know about the vehicle and is not configured."""

import math
from collections.abc import Iterator

from lcf_edge.doctor.finding import Context, Finding, edit, ok, warn

_MOUNTING = ("camera.height_m", "camera.pitch_rad")
_MOUNTED = "camera_{}"  # values of the diagnostics
_MOUNTING_SIGMAS = 3.0  # of what is learnt, and
_MAY_DIFFER = {"pitch_rad": math.radians(1), "yaw_rad": math.radians(1), "ahead_m": 0.2}  # from what is configured


def check(context: Context) -> Iterator[Finding]:
    """Lens, mounting, axes and speed."""
    yield from _lens(context)
    yield from _mounting(context)
    yield from _learnt_mounting(context)
    yield from _axes(context)
    yield _speed(context)


def _lens(context: Context) -> Iterator[Finding]:
    camera = context.config.camera
    if camera.driver == "recording" and not camera.intrinsics:
        return  # a recording may have its own
    if not camera.intrinsics:
        yield warn(
            "calibration",
            f"camera.intrinsics is not set: guessed from a field of view of {camera.horizontal_fov_rad:g} rad, "
            "bearings and times to contact are off",
            context.calibrate("camera"),
        )
        return
    fx, fy, cx, cy = camera.intrinsics
    middle = abs(cx / camera.width - 0.5) < 0.25 and abs(cy / camera.height - 0.5) < 0.25
    if middle and 0.8 < fx / fy < 1.25:
        yield ok("calibration", f"camera.intrinsics: focal length {fx:.0f} px, centre ({cx:.0f}, {cy:.0f})")
    else:
        yield warn(
            "calibration",
            f"camera.intrinsics: fx, fy, cx, cy = {camera.intrinsics} cannot be of {camera.width}x{camera.height} px; "
            "are they of another size?",
            context.calibrate("camera"),
        )


def _mounting(context: Context) -> Iterator[Finding]:
    camera = context.config.camera
    missing = [key for key in _MOUNTING if key not in context.given]
    values = f"height {camera.height_m:g} m, pitch {camera.pitch_rad:g} rad, yaw {camera.yaw_rad:g} rad"
    if missing and camera.driver != "recording":
        yield warn(
            "calibration",
            f"{' and '.join(missing)} not set, taken to be {values}: the ground may look like an obstacle",
            edit(context.path, "[camera] height_m, as measured; lcf-edge calibrate foe finds pitch_rad"),
        )
    else:
        yield ok("calibration", f"camera: {values}")


def _learnt_mounting(context: Context) -> Iterator[Finding]:
    """Compare the configured mounting with what a running daemon has learnt while driving."""
    status = context.daemon.statuses.get("pipeline") if context.daemon else None
    for key, may_differ in _MAY_DIFFER.items():
        what, unit = key.split("_")
        learnt, with_sigma = _MOUNTED.format(key), _MOUNTED.format(f"{what}_sigma_{unit}")
        if status is None or learnt not in status.values or with_sigma not in status.values:
            continue
        try:
            estimated, sigma = float(status.values[learnt]), float(status.values[with_sigma])
        except ValueError:
            continue  # a daemon of another version
        configured: float = getattr(context.config.camera, key)
        text = f"camera.{key} is {configured:g}, driving shows {estimated:.3f} ± {sigma:.3f}"
        if abs(estimated - configured) > max(_MOUNTING_SIGMAS * sigma, may_differ):
            yield warn("calibration", text, edit(context.path, f"[camera] {key} = {estimated:.3f}"))
        else:
            yield ok("calibration", text)


def _axes(context: Context) -> Iterator[Finding]:
    imu = context.config.imu
    if imu.driver in ("none", "recording"):
        return
    if imu.axes:
        yield ok("calibration", "imu.axes is set")
    else:
        yield warn(
            "calibration",
            "imu.axes is not set: the chip's axes are taken for the camera's (x right, y down, z ahead)",
            context.calibrate("imu"),
        )


def _speed(context: Context) -> Finding:
    vehicle, imu = context.config.vehicle, context.config.imu
    topic = f"{context.config.publish.prefix}/speed"
    if vehicle.speed_source in ("auto", "constant") and vehicle.speed_mps is not None:
        return ok("calibration", f"vehicle.speed_mps is {vehicle.speed_mps:g} where nothing better is known")
    if vehicle.speed_source in ("odometry", "zenoh"):
        return ok("calibration", f"the speed is taken from {topic}: somebody must publish it")
    if vehicle.speed_source == "imu" and imu.driver != "none":
        return warn(
            "calibration",
            "the speed is taken from the accelerometer alone, which drifts within seconds",
            edit(context.path, '[vehicle] speed_source = "auto", speed_mps = 1.0'),
        )
    if context.config.camera.driver == "recording":
        return ok("calibration", "the speed is taken from the recording, if it has one")
    return warn(
        "calibration",
        f"speed is unknown unless {topic} is published: without it there are no ranges",
        edit(context.path, '[vehicle] speed_source = "auto", speed_mps = 1.0, its usual speed'),
    )
