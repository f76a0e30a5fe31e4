"""The IMU: present, permitted, the configured one, and measuring what an IMU at rest should."""

import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from drivers.device import Device
from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    DeviceStalledError,
    DriverError,
    WrongDeviceError,
)
from drivers.imu.registry import has_interface
from drivers.imu.serial_port import ports
from drivers.samples import STANDARD_GRAVITY_MPS2, ImuSample
from lcf_edge.doctor import permissions
from lcf_edge.doctor.finding import Context, Finding, fail, ok, short, warn
from lcf_edge.doctor.health import daemon_having, of_device
from lcf_edge.doctor.measuring import Measured, measure
from lcf_edge.doctor.processes import Process, in_use, processes
from lcf_edge.doctor.wiring import Chip, chips, spoken, strangers

SECONDS = 2.0
SLOWEST_HZ = 50.0
_STILL_RADPS, _STILL_MPS2 = 0.03, 0.5  # 1 sigma of an axis at rest, the noisiest of the chips included
_GRAVITY_OFF_MPS2, _GRAVITY_WRONG_MPS2 = 0.4, 2.0
_BIAS_RADPS = 0.1
_BAD_SHARE = 0.01
_HARMLESS = frozenset({"skipped_bytes"})  # the first frame is rarely complete
_SOFTWARE_BUS = "dtoverlay=i2c-gpio,bus=3"


def check(context: Context) -> Iterator[Finding]:
    """The configured IMU."""
    imu = context.config.imu
    if imu.driver == "none":
        yield _none(context)
        return
    daemon = _daemon(context)
    if daemon is not None:
        yield of_device(context, "imu", daemon)
        return
    if has_interface(imu.driver, "serial"):
        yield from _latency(context)
    try:
        measured = measure(lambda: _opened(context), SECONDS, context.clock)
    except DriverError as error:
        yield _unusable(context, error)
        return
    if not measured.records and has_interface(imu.driver, "serial"):
        yield _other_protocol(context, f"{measured.name}: no sample came")
    else:
        yield from judged(context, measured)


def judged(context: Context, measured: Measured[ImuSample]) -> Iterator[Finding]:
    """Return findings about samples."""
    imu = context.config.imu
    if len(measured.records) < 2:
        yield fail("imu", f"{measured.name}: opens, but {len(measured.records)} samples came in {SECONDS:g} s")
        return
    summary = f"{measured.name}: {measured.summary()}"
    if measured.rate_hz < SLOWEST_HZ:
        remedy = "" if has_interface(imu.driver, "serial") else context.again("imu.rate_hz=200")
        yield warn("imu", f"{summary}, too few to follow a turn; {SLOWEST_HZ:g}/s at least, better 200", remedy)
    else:
        yield ok("imu", summary)
    yield from _losses(measured)
    if measured.steps_back:
        yield warn("imu", f"{measured.steps_back} stamps that are not after the one before")
    if imu.driver != "recording":
        yield from _at_rest(context, measured.records)


def _losses(measured: Measured[ImuSample]) -> Iterator[Finding]:
    if measured.counts["implausible"]:
        yield warn(
            "imu",
            f"{measured.counts['implausible']} reads came with flipped bits, as on a Raspberry Pi's own bus with a "
            "chip that stretches the clock; use a software bus at GPIO 23 (SDA) and 24 (SCL), docs/imus.md",
            f"echo {_SOFTWARE_BUS} | sudo tee -a /boot/firmware/config.txt  # reboot, then imu.bus = 3",
        )
    bad = {what: n for what, n in measured.counts.items() if what not in _HARMLESS | {"implausible"}}
    if sum(bad.values()) > max(_BAD_SHARE * len(measured.records), 1):
        summary = ", ".join(f"{what} {n}" for what, n in sorted(bad.items()))
        yield warn("imu", f"losses: {summary}; shorter wires, better supply, or a slower bus (docs/imus.md)")


def _at_rest(context: Context, samples: list[ImuSample]) -> Iterator[Finding]:
    gyro = np.array([sample.gyro for sample in samples])
    accel = np.array([sample.accel for sample in samples])
    if gyro.std(axis=0).max() > _STILL_RADPS or accel.std(axis=0).max() > _STILL_MPS2:
        yield warn(
            "imu", "moving, so gravity and bias cannot be measured", f"{context.again()}  # while it stands still"
        )
        return
    gravity_mps2 = float(np.linalg.norm(accel.mean(axis=0)))
    axes = ", ".join(f"{value:+.2f}" for value in accel.mean(axis=0))
    summary = f"gravity {gravity_mps2:.2f} m/s² (x, y, z: {axes})"
    off_mps2 = abs(gravity_mps2 - STANDARD_GRAVITY_MPS2)
    if off_mps2 > _GRAVITY_WRONG_MPS2:
        yield fail("imu", f"{summary} instead of 9.81: it does not send m/s², falls, or its accelerometer is broken")
    elif off_mps2 > _GRAVITY_OFF_MPS2:
        yield warn("imu", f"{summary} instead of 9.81", context.calibrate("imu"))
    else:
        yield ok("imu", summary)
    bias_radps = float(np.linalg.norm(gyro.mean(axis=0)))
    noise_radps = float(gyro.std(axis=0).max())
    summary = f"gyro at rest {bias_radps:.4f} rad/s, noise {noise_radps:.4f}"
    if bias_radps > _BIAS_RADPS:
        yield warn(
            "imu",
            f"{summary}: a large bias, or not rad/s; the daemon learns it, soonest while the vehicle stands",
            context.calibrate("imu"),
        )
    else:
        yield ok("imu", summary)


def _none(context: Context) -> Finding:
    text = "imu.driver is none: the vehicle's turns look like motion of others, and flow lines are widened"
    shared = daemon_having(context, "imu", context.dev / f"i2c-{context.config.imu.bus}") is not None
    found = [] if shared else _chips(context)  # looking could take a byte out of the FIFO that the daemon reads
    if found:
        there = f"{', '.join(map(str, found))} on i2c-{context.config.imu.bus}"
        return warn("imu", f"{text}; found {there}", context.again(*found[0].settings))
    iio = sorted(context.sys.glob("bus/iio/devices/iio:device*/in_anglvel_x_raw"))
    if iio:
        return warn("imu", f"{text}; the kernel has one", context.again("imu.driver=iio"))
    unknown = [] if shared else _strangers(context)
    if unknown:
        where = f"{', '.join(f'0x{address:02x}' for address in unknown)} on i2c-{context.config.imu.bus}"
        what = f"{text}; at {where} is a device that no driver recognises: a copy of an IMU?"
        return warn("imu", what, context.again("imu.driver=mpu6500", f"imu.address=0x{unknown[0]:02x}"))
    serial = ports(context.dev)
    there = f"; at a serial port: {', '.join(serial)}" if serial else ""
    return warn("imu", text + there, context.again("imu.driver=csv", f"imu.port={serial[0]}") if serial else "")


def _daemon(context: Context) -> Process | None:
    """Return the daemon that has the IMU open, or may have it."""
    imu = context.config.imu
    if imu.driver == "recording":
        return None
    if has_interface(imu.driver, "iio"):  # its files are open only briefly
        return next((process for process in processes(context.proc) if process.is_daemon), None)
    if not os.access(_node(context), os.R_OK | os.W_OK):
        return None  # opening it will say why
    return daemon_having(context, "imu", _node(context))


def _node(context: Context) -> Path:
    imu = context.config.imu
    return Path(imu.port) if has_interface(imu.driver, "serial") else context.dev / f"i2c-{imu.bus}"


def _opened(context: Context) -> Device[ImuSample]:
    device = context.open_imu(context.config, context.clock)
    if device is None:
        raise WrongDeviceError("imu.driver: none is configured; name one")
    return device


def _unusable(context: Context, error: DriverError) -> Finding:
    imu = context.config.imu
    if imu.driver == "recording":
        return fail("imu", str(error))
    if isinstance(error, DeviceForbiddenError):
        owner = "" if has_interface(imu.driver, "iio") else permissions.owner(_node(context))
        whose = f" (it belongs to the {owner})" if owner else ""
        return fail("imu", f"{short(error)}{whose}", permissions.join(permissions.group_of(imu.driver)))
    if has_interface(imu.driver, "iio"):
        return fail("imu", str(error), "sudo modprobe inv_mpu6050_i2c  # or the driver of your chip")
    if has_interface(imu.driver, "serial"):
        return _serial(context, error)
    return _i2c(context, error)


def _serial(context: Context, error: DriverError) -> Finding:
    port = context.config.imu.port
    if isinstance(error, DeviceMissingError):
        there = ports(context.dev)
        others = f"; there is {', '.join(there)}" if there else ", and no other"
        other = context.again(f"imu.port={there[0]}") if there else ""
        return fail("imu", short(error) + others, other or "lsusb  # with the IMU plugged in: does the kernel see it?")
    if isinstance(error, DeviceBusyError):
        return in_use("imu", Path(port), context.proc)
    if isinstance(error, DeviceStalledError):
        return fail("imu", str(error), f"timeout 5 cat {port} | hexdump -C | head  # does anything come?")
    if isinstance(error, WrongDeviceError):
        return _other_protocol(context, short(error))
    return fail("imu", str(error))


def _other_protocol(context: Context, text: str) -> Finding:
    imu = context.config.imu
    found = spoken(imu.port, context.clock)
    if found is None:
        return fail(
            "imu",
            f"{text}; no other protocol or baud rate fits either",
            f"timeout 5 cat {imu.port} | hexdump -C | head",
        )
    what = f"{text}; it speaks {found.driver} at {found.baud} baud"
    return fail("imu", what, context.again(*found.settings))


def _i2c(context: Context, error: DriverError) -> Finding:
    bus = context.config.imu.bus
    if not _node(context).exists() and isinstance(error, DeviceMissingError):
        return _no_bus(context, error)
    if isinstance(error, DeviceBusyError):
        return fail("imu", short(error), context.again("imu.driver=iio"))
    found = _chips(context)
    if found and isinstance(error, DeviceMissingError | WrongDeviceError):
        there = ", ".join(map(str, found))
        remedy = context.again(*found[0].settings)
        return fail("imu", f"{short(error)}; found {there}", remedy)
    if isinstance(error, DeviceMissingError | DeviceLostError):
        return fail("imu", str(error), f"sudo i2cdetect -y {bus}  # nothing there: check VCC, GND, SDA, SCL")
    return fail("imu", str(error))


def _no_bus(context: Context, error: DriverError) -> Finding:
    bus = context.config.imu.bus
    there = sorted(context.dev.glob("i2c-*"))
    model = context.sys / "firmware/devicetree/base/model"
    if (context.sys / f"bus/i2c/devices/i2c-{bus}").exists():
        remedy = "sudo modprobe i2c-dev"
    elif model.exists() and "Raspberry" in model.read_text(encoding="utf-8", errors="replace"):
        own = bus == 3  # the number in the documentation
        remedy = (
            f"echo {_SOFTWARE_BUS} | sudo tee -a /boot/firmware/config.txt  # then reboot"
            if own
            else "sudo raspi-config nonint do_i2c 0"
        )
    elif there:
        remedy = context.again(f"imu.bus={there[0].name.removeprefix('i2c-')}")
    else:
        remedy = "sudo modprobe i2c-dev"
    others = f"; there is {', '.join(map(str, there))}" if there else ", and no other"
    return fail("imu", short(error) + others, remedy)


def _chips(context: Context) -> list[Chip]:
    """On the configured bus; none where it cannot be opened."""
    try:
        with closing(context.open_bus(context.config.imu.bus)) as bus:
            return list(chips(bus))
    except DriverError:
        return []


def _strangers(context: Context) -> list[int]:
    """On the configured bus; none where it cannot be opened."""
    try:
        with closing(context.open_bus(context.config.imu.bus)) as bus:
            return strangers(bus)
    except DriverError:
        return []


def _latency(context: Context) -> Iterator[Finding]:
    """Check the latency timer of an FTDI adapter, which holds bytes back."""
    name = Path(context.config.imu.port).resolve().name
    timer = context.sys / "bus/usb-serial/devices" / name / "latency_timer"
    if timer.exists() and (latency_ms := int(timer.read_text(encoding="ascii"))) > 1:
        text = f"{name}: the adapter holds bytes back for {latency_ms} ms"
        yield warn("imu", text, f"echo 1 | sudo tee {timer}  # sudo make install brings a rule that lasts")
