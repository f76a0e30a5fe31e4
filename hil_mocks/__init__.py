"""Stand-ins for hardware, below the drivers, so that the shipped code runs without a device.

``i2c``: IMU chips as registers behind the interface of smbus2. ``serial_imu``: a serial IMU on a pseudo-terminal.
``v4l2_device``: cameras behind the kernel's V4L2 interface.
``virtual_clock``: time that a test advances. All of them can inject faults.

``closed_loop``: a vehicle in a world rendered by ``lcf_edge.rendered``, whose decisions change what it sees next.
``vm``: the installed service on a kernel of its own.
"""
