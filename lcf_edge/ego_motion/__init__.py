"""How the vehicle moved from one frame to the next, from IMU, speed and images. No clock, no I/O.

``estimator`` does all of it. It uses ``sample_ring`` (the samples of the last seconds), ``gyro_bias`` (and
``axis_bias``, its filter) and ``inertial_speed``; ``image_rotation`` measures the rotation in the images where the
gyro does not give it well, and ``stillness`` detects in images that the vehicle is stationary.
"""
