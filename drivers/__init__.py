"""Cameras and IMUs: one file a chip or protocol; nothing about the filter.

A driver knows its device and turns it into ``Frame`` or ``ImuSample`` (``samples``) in SI units, stamped on the
monotonic clock. ``device`` is the interface of every driver, and keeps one open; ``errors`` what can go wrong.
By hand: ``python -m drivers.camera.v4l2 --help``, ``python -m drivers.imu.mpu6050 --help``.
"""
