"""The other end: scenes as they arrive."""

import weakref
from collections.abc import Iterator

import zenoh

from lcf_edge import config
from lcf_edge.cdr import CdrError, decode_scene
from lcf_edge.errors import PublishError
from lcf_edge.records import Scene
from lcf_edge.zenoh_link.session import close_session, open_session, reason


class Scenes(Iterator[Scene]):
    """An iterator over scenes that waits for the next one. Close it, or let it go.

    ``broken`` counts payloads that were no scene; they are skipped.
    """

    def __init__(self, options: config.Zenoh, key: str, kept: int) -> None:
        self.broken = 0
        session = open_session(options)
        self._close = weakref.finalize(self, close_session, session)
        try:
            self._subscriber = session.declare_subscriber(key, zenoh.handlers.RingChannel(kept))
        except zenoh.ZError as error:
            self.close()
            raise PublishError(f"{key}: {reason(error)}") from error

    def __next__(self) -> Scene:
        while self._close.alive:
            try:
                payload = self._subscriber.recv().payload.to_bytes()
                return decode_scene(payload)
            except CdrError:
                self.broken += 1
            except zenoh.ZError:  # closed while it waited
                break
        raise StopIteration

    def close(self) -> None:
        """Unsubscribe; a wait in another thread ends."""
        self._close()


def scenes(endpoint: str, key: str = "lcf/scene", *, kept: int = 64, config_file: str = "") -> Scenes:
    """Subscribe to a running pipeline: yields each scene until interrupted.

    Connects to ``endpoint`` (for example ``tcp/127.0.0.1:7447``) now or as soon as somebody listens there, and again
    when the connection was lost. Of scenes not yet asked for the newest ``kept`` wait; what is no scene is skipped and
    counted. ``config_file``: a Zenoh configuration (JSON5), for TLS. Raises ``PublishError`` for a bad endpoint, key
    or file.
    """
    return Scenes(config.Zenoh(connect=[endpoint], listen=[], config_file=config_file), key, kept)
