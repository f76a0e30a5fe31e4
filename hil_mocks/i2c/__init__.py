"""I2C IMUs simulated at register level, behind the interface of smbus2, for the shipped drivers.

``bus`` connects the chips and injects bus faults, ``chip`` is their base, ``motion`` the motion that they measure (a
recording). ``CHIPS`` maps the driver's name in ``imu.driver`` to a model. Sensitivities are derived here independently,
from the full scale, not taken from the drivers.
"""

from hil_mocks.i2c.bmi import Bmi160, Bmi270
from hil_mocks.i2c.bmi088 import Bmi088
from hil_mocks.i2c.bno055 import Bno055
from hil_mocks.i2c.bno08x import Bno08x
from hil_mocks.i2c.bus import SimulatedBus
from hil_mocks.i2c.chip import SimulatedChip
from hil_mocks.i2c.icm20948 import Icm20948
from hil_mocks.i2c.icm42688 import Icm42688
from hil_mocks.i2c.lsm6 import Ism330dhcx, Lsm6ds3, Lsm6dso, Lsm6dso32, Lsm6dsv, Lsm6dsv32
from hil_mocks.i2c.lsm9ds1 import Lsm9ds1
from hil_mocks.i2c.motion import Motion, replay
from hil_mocks.i2c.mpu import Icm20602, Mpu6050, Mpu6500, Mpu9250
from hil_mocks.i2c.qmi8658 import Qmi8658

CHIPS: dict[str, type[SimulatedChip]] = {
    "mpu6050": Mpu6050,
    "mpu6500": Mpu6500,
    "mpu9250": Mpu9250,
    "icm20602": Icm20602,
    "icm20948": Icm20948,
    "icm42688": Icm42688,
    "lsm6ds3": Lsm6ds3,
    "lsm6dso": Lsm6dso,
    "lsm6dso32": Lsm6dso32,
    "ism330dhcx": Ism330dhcx,
    "lsm6dsv": Lsm6dsv,
    "lsm6dsv32": Lsm6dsv32,
    "lsm9ds1": Lsm9ds1,
    "bmi088": Bmi088,
    "bmi160": Bmi160,
    "bmi270": Bmi270,
    "qmi8658": Qmi8658,
    "bno055": Bno055,
    "bno08x": Bno08x,
}

__all__ = ["CHIPS", "Motion", "SimulatedBus", "SimulatedChip", "replay"]
