"""Everything that goes over Zenoh, and the session that carries it.

``session`` opens and closes it; ``admission`` says what a daemon takes in; ``publisher`` puts messages, ``scene``,
``preview`` and ``diagnostics`` those of one key each; ``ros2`` shows them to nodes under rmw_zenoh; ``speed_input`` and
``queryables`` listen; ``subscription`` is the other end; ``own_gate`` starts the process before the daemon's loopback
port; ``link`` combines them for the daemon. No process forks while a session is open: others are started as new
programs.
"""

from lcf_edge.zenoh_link.publisher import ATTACHMENT
from lcf_edge.zenoh_link.scene import SCENE_ENCODING, ScenePublisher, scene_key
from lcf_edge.zenoh_link.session import MAX_MESSAGE_BYTES, close_session, open_session, opened_session
from lcf_edge.zenoh_link.subscription import Scenes, scenes

__all__ = [
    "ATTACHMENT",
    "MAX_MESSAGE_BYTES",
    "SCENE_ENCODING",
    "ScenePublisher",
    "Scenes",
    "close_session",
    "open_session",
    "opened_session",
    "scene_key",
    "scenes",
]
