"""Stand-ins for hardware, below the drivers, so that the shipped code runs without a device; and rendered drives.

``i2c``: IMU chips as registers behind the interface of smbus2. ``serial_imu``: a serial IMU on a pseudo-terminal.
``v4l2_device``: cameras behind the kernel's V4L2 interface. ``playback``: a recording as camera, IMU and odometry.
``virtual_clock``: time that a test turns by hand. All of them go wrong on request.

``scenes`` is the entry to rendered drives with exact truth. It rests on ``drives`` (what a drive is), ``layouts`` and
``plan`` (the kinds of drive), ``trajectory`` (how the vehicle moves), ``projection`` (what appears where), ``textures``
and ``rendering`` (pictures) and ``truth`` (time to contact, misses, threats).
"""
