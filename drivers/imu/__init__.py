"""IMUs: one file per chip or protocol, each runnable by hand (``python -m drivers.imu.mpu6050 --help``).

``registry`` lists them all, ``settings`` has the requested rate and ranges. I2C: ``i2c_bus`` does the transfers,
``i2c_imu`` and ``fifo_imu`` contain what the chips share, ``i2c_chips`` opens one by name. ``iio``: chips that the
kernel owns. Serial: ``serial_port``, ``serial_frames`` and ``serial_imu`` contain what the protocols share.
"""
