"""The subscriber's side: scenes as they arrive."""

import weakref
from collections.abc import Iterator

import zenoh

from lcf_edge import config
from lcf_edge.cdr import CdrError, decode_scene
from lcf_edge.errors import PublishError
from lcf_edge.messages import Scene
from lcf_edge.zenoh_link.scene import SCENE
from lcf_edge.zenoh_link.session import close_session, open_session, reason


def reading_from(endpoint: str, config_file: str = "") -> config.Zenoh:
    """Return the options of a session that only reads: it waits for a daemon or a router at ``endpoint``.

    Its mode is "router", a leaf since it listens nowhere: a router passes a peer nothing from other peers, and a client
    cannot wait.
    """
    return config.Zenoh(mode="router", connect=[endpoint], listen=[], config_file=config_file)


class Scenes(Iterator[Scene]):
    """An iterator over scenes that waits for the next one. Close it, or let it go.

    ``key``: of the last scene, which names the rover if several match. ``broken``: number of payloads that were no
    scene, and were skipped.
    """

    def __init__(self, options: config.Zenoh, key: str, kept: int) -> None:
        self.key = ""
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
                sample = self._subscriber.recv()
                scene = decode_scene(SCENE.payload(sample))
            except CdrError:
                self.broken += 1
            except zenoh.ZError:  # closed while it waited
                break
            else:
                self.key = str(sample.key_expr)
                return scene
        raise StopIteration

    def close(self) -> None:
        """Unsubscribe; a wait in another thread ends."""
        self._close()


def scenes(endpoint: str, key: str = "lcf/scene", *, kept: int = 64, config_file: str = "") -> Scenes:
    """Subscribe to a running pipeline: yields each scene until interrupted.

    Connects to ``endpoint``, a daemon or a router (``tcp/127.0.0.1:7447``), now or as soon as it listens, and again
    when the connection was lost. At most the ``kept`` newest scenes queue; payloads that are no scene are skipped and
    counted. ``config_file``: a Zenoh configuration (JSON5), for TLS. Raises ``PublishError`` for a bad endpoint, key
    or file.
    """
    return Scenes(reading_from(endpoint, config_file), key, kept)
