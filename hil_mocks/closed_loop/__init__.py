"""A vehicle in a rendered world: its decisions change what its camera sees next.

``course``   the path that it is to drive
``vehicle``  its dynamics: delay, lag, limits, differential drive or bicycle
``world``    stationary and moving bodies, and who yields to whom
``worlds``   worlds from seeds; ``draft`` builds one, ``events`` are what happens in it
``sensors``  a shaken camera, IMU, wheel odometry
``exact``    ground truth of each image, also as the records of objects
``loop``     one drive in lockstep
``outcome``  its result: collisions, brakings, false ones, speed
``live``     the daemon in the vehicle, in real time
"""
