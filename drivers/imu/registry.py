"""All IMU drivers: the one list that configuration, ``lcf-edge doctor``, documents and tests read.

A new IMU is a module here, one row below, a model in ``hil_mocks`` and a row in ``docs/imus.md``. Modules are imported
only when needed, so that a vehicle with one chip does not load the drivers of the others.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

if TYPE_CHECKING:
    from drivers.imu.i2c_chips import I2cChip
    from drivers.imu.serial_imu import SerialProtocol

Interface: TypeAlias = Literal["i2c", "serial", "iio"]


@dataclass(frozen=True, slots=True)
class ImuDriver:
    """Location of a driver. ``name``: its value of ``imu.driver``."""

    name: str
    interface: Interface
    module: str  # of this package
    attribute: str  # in the module: a class, or a serial protocol

    def load(self) -> Any:
        """Import the module; return the class or protocol."""
        return getattr(import_module(f"drivers.imu.{self.module}"), self.attribute)


DRIVERS = {
    driver.name: driver
    for driver in (
        ImuDriver("mpu6050", "i2c", "mpu6050", "Mpu6050"),
        ImuDriver("mpu6500", "i2c", "mpu6500", "Mpu6500"),
        ImuDriver("mpu9250", "i2c", "mpu9250", "Mpu9250"),
        ImuDriver("icm20602", "i2c", "icm20602", "Icm20602"),
        ImuDriver("icm20948", "i2c", "icm20948", "Icm20948"),
        ImuDriver("icm42688", "i2c", "icm42688", "Icm42688"),
        ImuDriver("lsm6ds3", "i2c", "lsm6ds3", "Lsm6ds3"),
        ImuDriver("lsm6dso", "i2c", "lsm6dso", "Lsm6dso"),
        ImuDriver("lsm6dso32", "i2c", "lsm6dso32", "Lsm6dso32"),
        ImuDriver("ism330dhcx", "i2c", "ism330dhcx", "Ism330dhcx"),
        ImuDriver("lsm6dsv", "i2c", "lsm6dsv", "Lsm6dsv"),
        ImuDriver("lsm6dsv32", "i2c", "lsm6dsv32", "Lsm6dsv32"),
        ImuDriver("lsm9ds1", "i2c", "lsm9ds1", "Lsm9ds1"),
        ImuDriver("bmi088", "i2c", "bmi088", "Bmi088"),
        ImuDriver("bmi160", "i2c", "bmi160", "Bmi160"),
        ImuDriver("bmi270", "i2c", "bmi270", "Bmi270"),
        ImuDriver("qmi8658", "i2c", "qmi8658", "Qmi8658"),
        ImuDriver("bno055", "i2c", "bno055", "Bno055"),
        ImuDriver("bno08x", "i2c", "bno08x", "Bno08x"),
        ImuDriver("iio", "iio", "iio", "Iio"),
        ImuDriver("witmotion", "serial", "witmotion", "PROTOCOL"),
        ImuDriver("witmotion_ble", "serial", "witmotion_ble", "PROTOCOL"),
        ImuDriver("bno08x_rvc", "serial", "bno08x_rvc", "PROTOCOL"),
        ImuDriver("bno08x_uart", "serial", "bno08x_uart", "PROTOCOL"),
        ImuDriver("xsens", "serial", "xsens", "PROTOCOL"),
        ImuDriver("csv", "serial", "csv_line", "PROTOCOL"),
    )
}
"""By name."""


def names(interface: Interface) -> list[str]:
    """The drivers of one interface."""
    return [driver.name for driver in DRIVERS.values() if driver.interface == interface]


def has_interface(name: str, interface: Interface) -> bool:
    """Whether the driver exists and has that interface; "none" and "recording" have none."""
    return name in DRIVERS and DRIVERS[name].interface == interface


def chips() -> dict[str, "type[I2cChip]"]:
    """The classes of all chips on I2C, by driver."""
    return {name: DRIVERS[name].load() for name in names("i2c")}


def protocols() -> dict[str, "SerialProtocol"]:
    """The protocols of all serial IMUs, by driver."""
    return {name: DRIVERS[name].load() for name in names("serial")}
