"""Cameras: images with the time of their exposure.

``v4l2`` is the driver for the kernel's interface, ``libcamera`` that for libcamera. They use ``v4l2_ioctl`` (system
calls), ``v4l2_errors`` (error numbers as messages), ``find`` (device names), ``offers`` (sizes and rates), ``controls``
(exposure, gain, power line), ``luminance`` (buffers to grey) and ``jpeg`` (sizes from JPEG headers).
"""
