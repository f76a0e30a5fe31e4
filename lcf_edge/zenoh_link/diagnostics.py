"""Diagnostics: the status of each device and of the pipeline."""

from collections.abc import Sequence

import zenoh

from lcf_edge import config
from lcf_edge.cdr import encode_diagnostics
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.zenoh_link.publisher import MessagePublisher
from lcf_edge.zenoh_link.ros2 import Ros2Node
from lcf_edge.zenoh_link.topics import ZenohTopic

DIAGNOSTICS = ZenohTopic("diagnostics", "diagnostic_msgs/msg/DiagnosticArray", zenoh.Priority.DATA_LOW)


class DiagnosticsPublisher:
    """Puts the status of every device on ``<prefix>/diagnostics``."""

    def __init__(self, session: zenoh.Session, publish: config.Publish, ros2: Ros2Node | None = None) -> None:
        self._robot = publish.robot
        self._publisher = MessagePublisher(session, publish, DIAGNOSTICS, ros2)
        self.counts = self._publisher.counts

    def put(self, status: Sequence[DeviceStatus], stamp_ns: int) -> None:
        """Send one status per device, as of ``stamp_ns`` of the system clock."""
        self._publisher.put(encode_diagnostics(stamp_ns, self._robot, status))
