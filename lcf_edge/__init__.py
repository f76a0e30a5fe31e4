"""lcf-edge: the Line-Circle filter for a small vehicle's computer.

Data flows one way: a source of frames, IMU samples and speed (a recording or drivers) → ``pipeline`` →
``corners`` → ``filter`` → a ``Scene`` (``messages``) → sinks (Zenoh, JSON lines, video, plot).
"""

__version__ = "0.1.0"

from lcf_edge.compilation import use_compiled

use_compiled()
