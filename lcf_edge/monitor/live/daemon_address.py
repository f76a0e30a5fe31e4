"""The address of a daemon."""

from dataclasses import dataclass

from lcf_edge import config
from lcf_edge.zenoh_link.subscription import reading_from


@dataclass(frozen=True, slots=True)
class DaemonAddress:
    """Where a daemon or a router listens, and the prefix of the daemon's keys."""

    endpoint: str  # tcp/127.0.0.1:7447
    prefix: str = "lcf"
    config_file: str = ""  # Zenoh's own (JSON5), for TLS

    def zenoh(self) -> config.Zenoh:
        """The session that connects to it."""
        return reading_from(self.endpoint, self.config_file)
