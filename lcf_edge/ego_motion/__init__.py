"""How the vehicle moved from one frame to the next, from IMU, speed and pictures. No clock, no I/O.

``estimator`` is the whole of it. It rests on ``sample_ring`` (the samples of the last seconds), ``gyro_bias`` (and
``axis_bias``, its filter) and ``inertial_speed``; ``image_rotation`` measures the rotation in the pictures where the
gyro does not give it well, and ``stillness`` says by them whether the vehicle stands.
"""
