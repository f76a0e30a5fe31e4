"""IMUs: one file a chip or protocol, each of them runnable by hand (``python -m drivers.imu.mpu6050 --help``).

``registry`` lists them all, ``settings`` says what is asked of one. Over I2C: ``i2c_bus`` does the transfers,
``i2c_imu`` and ``fifo_imu`` hold what the chips share, ``i2c_chips`` opens one by name. ``iio``: chips that the kernel
owns. Over a serial port: ``serial_port``, ``serial_frames`` and ``serial_imu`` hold what the protocols share.
"""
