"""Scenes over Zenoh, on a session of their own: what ``replay --publish`` does."""

from collections.abc import Callable

from drivers.samples import Frame
from lcf_edge.config import Config
from lcf_edge.messages import PipelineScene, View
from lcf_edge.sinks.sink import Sink
from lcf_edge.zenoh_link import ScenePublisher, close_session, open_session


class SceneSink(Sink):
    """Publishes each scene by ``config.publish``. Raises ``PublishError`` when the session cannot be opened."""

    name = "scenes"

    def __init__(self, config: Config) -> None:
        self._session = open_session(config.zenoh)
        try:
            self._publisher = ScenePublisher(self._session, config.publish)
        except BaseException:
            close_session(self._session)
            raise

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:  # noqa: ARG002
        """Publish one scene. Raises ``CdrError``."""
        self._publisher.put(scene)

    def close(self) -> None:
        """Close the session."""
        close_session(self._session)
