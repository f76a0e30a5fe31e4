"""Cameras and IMUs: one file per chip or protocol, independent of the filter.

A driver turns its device's data into ``Frame`` or ``ImuSample`` (``samples``) in SI units, stamped on the monotonic
clock. ``device`` defines the interface of every driver, and keeps one open; ``errors`` defines what can go wrong.
By hand: ``python -m drivers.camera.v4l2 --help``, ``python -m drivers.imu.mpu6050 --help``.
"""
