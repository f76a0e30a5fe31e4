"""A vehicle in a rendered world: what it decides changes what its camera sees next.

``course``   where it is to go
``vehicle``  how it moves: delay, lag, limits, differential drive or bicycle
``world``    what stands and moves, and who yields to whom
``worlds``   worlds from seeds; ``draft`` one in the making, ``events`` what happens in it
``sensors``  a shaken camera, IMU, wheel odometry
``exact``    the truth about each image, also as the records of objects
``loop``     one drive in lockstep
``outcome``  what came of it: collisions, brakings, those for nothing, speed
``live``     the daemon in the vehicle, in real time
"""
