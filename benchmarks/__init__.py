"""Measurements: detection quality and speed of the filter and its peers (``python -m benchmarks.run``).

``score``    compares results with the ground truth of rendered drives
``methods``  the filter and its peers behind one interface; ``peers`` holds the peers
``playing``  feeds drives and recordings to methods
``closed_loop``  a planner drives on the results of a method (``python -m benchmarks.closed_loop``), with ``drivers``
                 and ``drive_video``; ``calibration``  accuracy of objects' numbers and their sigmas; ``mounting``  of
                 the learnt mounting
``quality``, ``speed``, ``memory``  what is measured; ``report`` makes tables of it
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as on the vehicle; only before NumPy is loaded does it count
