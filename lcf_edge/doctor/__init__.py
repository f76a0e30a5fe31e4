"""``lcf-edge doctor``: checks of a vehicle's computer, devices and configuration.

``examination`` has the order of the checks and runs them, each within a time limit. A check is a function from a
``Context`` to its ``Finding``s (both in ``finding``), in a file by its subject: ``configuration``, ``software``,
``board``, ``clock``, ``memory``, ``service``, ``instances``, ``network``, ``health``, ``permissions``, ``camera``,
``imu``, ``calibration``. They use ``daemon`` (one that runs already, asked over Zenoh), ``endpoints`` and
``processes`` (who has what open), ``measuring`` (a device, read for a while), ``wiring`` (which chip or protocol
answers) and ``program`` (how a remedy calls this program).
"""
