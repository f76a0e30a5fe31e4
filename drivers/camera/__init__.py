"""Cameras: images with the time of their exposure.

``v4l2`` is the driver. It rests on ``v4l2_ioctl`` (the kernel's interface), ``v4l2_errors`` (what its error numbers
mean to a user), ``find`` (which node is meant), ``offers`` (sizes and rates), ``controls`` (exposure, gain, power line)
``luminance`` (from the bytes of a buffer to grey) and ``jpeg`` (how large an image in one of its formats is).
"""
