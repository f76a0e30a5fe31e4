"""A WebSocket server for Foxglove that passes on what a daemon publishes, byte by byte, with its definitions.

It draws the annotations from the scenes itself, so that they cost the daemon nothing. It subscribes to a
topic only while a client of it does. Clients can read and nothing else.
"""

import logging
import threading
import time
from collections import Counter
from typing import Any

import foxglove
import zenoh
from foxglove.websocket import ChannelView, Client, ServerListener

from lcf_edge.cdr import CdrError, decode_scene
from lcf_edge.errors import LcfError, PublishError
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.recording.write.schemas import ENCODING, schema
from lcf_edge.standard_messages.image_annotations import encode_image_annotations
from lcf_edge.zenoh_link.diagnostics import DIAGNOSTICS
from lcf_edge.zenoh_link.preview import PREVIEW
from lcf_edge.zenoh_link.scene import SCENE
from lcf_edge.zenoh_link.session import close_session, open_session, reason
from lcf_edge.zenoh_link.topics import ANNOTATIONS, STANDARD, ZenohTopic

BACKLOG = 64  # messages that wait for a slow client, 3 s of scenes; then the oldest are dropped

RELAYED = (SCENE, DIAGNOSTICS, PREVIEW, *STANDARD)


class Relay(ServerListener):
    """Serves at ``host``:``port`` (0: any) until it is closed.

    ``broken`` counts payloads that do not match their key; they are not passed on. Raises ``PublishError``
    for an invalid address, ``LcfError`` when the port cannot be listened to.
    """

    def __init__(self, address: DaemonAddress, host: str, port: int) -> None:
        self.broken = 0
        self._prefix = address.prefix
        self._lock = threading.Lock()
        self._clients: Counter[str] = Counter()  # number, by topic
        self._subscribers: dict[str, Any] = {}
        foxglove.set_log_level(logging.CRITICAL)  # it logs a line for any nonsense of a client
        self._context = context = foxglove.Context()  # lives as long as this reference
        self._channels = {f"/{_key(topic, address)}": (topic, _channel(topic, address, context)) for topic in RELAYED}
        self._session = open_session(address.zenoh())
        try:
            self._server = foxglove.start_server(
                name="lcf-edge",
                host=host,
                port=port,
                server_listener=self,
                context=context,
                message_backlog_size=BACKLOG,
            )
        except (RuntimeError, OSError) as error:
            close_session(self._session)
            raise LcfError(f"{host}:{port}: cannot listen ({error}); name another with --port") from error
        self.port = self._server.port

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        """Subscribe at the daemon for the first client."""
        with self._lock:
            self._clients[channel.topic] += 1
            if channel.topic not in self._subscribers:
                self._subscribers[channel.topic] = self._subscribed(*self._channels[channel.topic])

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        """Unsubscribe after the last one."""
        with self._lock:
            self._clients[channel.topic] -= 1
            if self._clients[channel.topic] <= 0:
                subscriber = self._subscribers.pop(channel.topic, None)
                if subscriber is not None:
                    subscriber.undeclare()

    def close(self) -> None:
        """Disconnect from clients and daemon."""
        self._server.stop()
        close_session(self._session)

    def _subscribed(self, topic: ZenohTopic, channel: foxglove.Channel) -> Any:
        makes = topic is ANNOTATIONS
        source = SCENE if makes else topic

        def receive(sample: zenoh.Sample) -> None:
            try:
                payload = source.payload(sample)
                if makes:
                    payload = encode_image_annotations(decode_scene(payload))
            except CdrError:
                self.broken += 1
            else:
                channel.log(payload, log_time=time.time_ns())

        handler: Any = zenoh.handlers.Callback(receive, indirect=False)
        return self._session.declare_subscriber(source.key(self._prefix), handler)


def _key(topic: ZenohTopic, address: DaemonAddress) -> str:
    """Raises ``PublishError`` for an invalid prefix."""
    try:
        return str(zenoh.KeyExpr(topic.key(address.prefix)))
    except zenoh.ZError as error:
        raise PublishError(f"{address.prefix}: {reason(error)}; name another prefix") from error


def _channel(topic: ZenohTopic, address: DaemonAddress, context: foxglove.Context) -> foxglove.Channel:
    definition = foxglove.Schema(name=topic.message, encoding=ENCODING, data=schema(topic.message))
    return foxglove.Channel(f"/{_key(topic, address)}", schema=definition, message_encoding="cdr", context=context)
