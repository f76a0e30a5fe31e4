"""``lcf-edge calibrate``: measures the parameters of this camera and this IMU for the configuration.

``camera`` finds the lens from views of a ``target``; ``rest`` the gyro's bias and noise; ``motions`` the IMU's axes
from motions by hand; ``alignment`` those axes and the clocks' offset (``time_offset``) from the gyro against
``image_rotation``; ``foe`` how the camera is mounted. ``tracks`` follows corners for the last three. ``mask`` finds own
parts in view, ``drawing`` has them drawn. ``sources`` delivers the data of devices or a recording, ``guide`` prompts
the user, ``result`` is what each returns, ``report`` draws it, ``config_file`` writes it.
"""
