"""The interface that the daemon needs of its link to the outside."""

from collections import Counter
from collections.abc import Sequence
from typing import Protocol

from drivers.samples import SpeedSample
from lcf_edge.config import Config
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.messages import Scene


class Link(Protocol):
    """Never blocks, never raises; failures are counted in ``counts``. Stamps are of the system clock."""

    @property
    def counts(self) -> Counter[str]:
        """Counts so far, by part."""
        ...

    def put_scene(self, scene: Scene) -> None:
        """Publish a scene."""
        ...

    def put_diagnostics(self, status: Sequence[DeviceStatus], stamp_ns: int) -> None:
        """Publish the status of each part."""
        ...

    def has_preview_subscriber(self) -> bool:
        """Whether somebody subscribes, and the next preview is due."""
        ...

    def put_preview(self, jpeg: bytes, stamp_ns: int) -> None:
        """Publish a preview."""
        ...

    def take_speeds(self) -> list[tuple[int, SpeedSample]]:
        """Return the speeds since the last call, each with its arrival (monotonic, ns) and its sender's stamp."""
        ...

    def show_config(self, config: Config) -> None:
        """Set the answer to queries for the configuration."""
        ...

    max_sessions: int
    """Largest number of sessions at a time."""

    @property
    def sessions(self) -> int:
        """Number of peers connected now."""
        ...

    @property
    def charged_mib(self) -> float:
        """Growth of the process's memory that was charged to peers so far, MiB."""
        ...

    def charge(self, grown_mib: float) -> None:
        """Charge growth since the last call, MiB, to the peers that have sent something meanwhile."""
        ...

    def cut(self, charge_mib: float) -> int:
        """Cut connections that are charged with that much, MiB, or more. Return how many."""
        ...

    def renew(self) -> bool:
        """Reopen the session, which drops all that peers have declared; False: there is no session now, call again."""
        ...

    def close(self) -> None:
        """Close the link, in bounded time."""
        ...
