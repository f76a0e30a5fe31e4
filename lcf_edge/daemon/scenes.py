"""Scenes on the daemon's link."""

from collections.abc import Callable

from drivers.samples import Frame
from lcf_edge.daemon.link import Link
from lcf_edge.messages import PipelineScene, View
from lcf_edge.sinks.sink import Sink


class LinkedScenes(Sink):
    """Publishes each scene on ``link``, which it does not close."""

    name = "scenes"

    def __init__(self, link: Link) -> None:
        self._link = link

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:  # noqa: ARG002
        """Publish one scene."""
        self._link.put_scene(scene)

    def close(self) -> None:
        """Do nothing: diagnostics still go over the link."""
