"""Cameras and IMUs: one file a chip or protocol; nothing about the filter.

A driver knows its device and turns it into ``Frame`` or ``ImuSample`` (``records``) in SI units and the
camera's axes: x right, y down, z forward.
"""
