"""What the daemon asks of its link to the outside."""

from collections import Counter
from collections.abc import Sequence
from typing import Protocol

from drivers.samples import SpeedSample
from lcf_edge.config import Config
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.messages import Scene


class Link(Protocol):
    """Never blocks, never raises; what went wrong is in ``counts``. Stamps are of the system clock."""

    @property
    def counts(self) -> Counter[str]:
        """What happened so far, by part."""
        ...

    def put_scene(self, scene: Scene) -> None:
        """Publish a scene."""
        ...

    def put_diagnostics(self, status: Sequence[DeviceStatus], stamp_ns: int) -> None:
        """Publish how each part is."""
        ...

    def has_preview_subscriber(self) -> bool:
        """Whether somebody looks, and the next picture is due."""
        ...

    def put_preview(self, jpeg: bytes, stamp_ns: int) -> None:
        """Publish a picture."""
        ...

    def take_speeds(self) -> list[tuple[int, SpeedSample]]:
        """When each speed since the last call arrived, and the speed with its sender's stamp."""
        ...

    def show_config(self, config: Config) -> None:
        """What to answer when somebody asks for the configuration."""
        ...

    most_sessions: int
    """That can be at a time."""

    @property
    def sessions(self) -> int:
        """Others that are connected now."""
        ...

    @property
    def charged_mib(self) -> float:
        """Growth of the process's memory that was laid to peers so far."""
        ...

    def charge(self, grown_mib: float) -> None:
        """Lay growth since the last call to the peers that have sent something meanwhile."""
        ...

    def cut(self, charge_mib: float) -> int:
        """Cut connections to which that much is laid. Return how many."""
        ...

    def renew(self) -> bool:
        """Drop all that peers have declared, and everybody for a moment; False: there is no session now, call again."""
        ...

    def close(self) -> None:
        """End it, within a bounded time."""
        ...
