"""``/metrics`` on a port of loopback: one connection at a time, and none for longer than two seconds."""

import socket
import threading
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

from lcf_edge.errors import LcfError
from lcf_edge.metrics.text import CONTENT_TYPE

HOST = "127.0.0.1"
_HOSTS = {"127.0.0.1", "localhost", "[::1]"}
_WITHIN_S = 2.0


class Endpoint:
    """Serves ``text`` in a thread of its own. Raises ``LcfError`` when the port cannot be listened to."""

    def __init__(self, port: int) -> None:
        self.text = b""
        endpoint = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                host = self.headers.get("Host", "")
                if host.rsplit(":", 1)[0] not in _HOSTS and host not in _HOSTS:
                    self.send_error(403)  # another host name that points here
                elif self.path != "/metrics":
                    self.send_error(404)
                else:
                    self.send_response(200)
                    self.send_header("Content-Type", CONTENT_TYPE)
                    self.send_header("Content-Length", str(len(endpoint.text)))
                    self.end_headers()
                    self.wfile.write(endpoint.text)

            def log_message(self, *_: object) -> None:
                """Log nothing: clients may ask often."""

        try:
            self._server = _Server((HOST, port), Handler)
        except OSError as error:
            raise LcfError(f"metrics.port: {HOST}:{port}: {error.strerror}; name another") from error
        self.port = self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, name="metrics", daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def close(self) -> None:
        """Serve no more."""
        if self._thread.is_alive():
            ending = threading.Thread(target=self._server.shutdown, daemon=True)
            ending.start()
            self._server.cut()  # else it would wait for that connection to end
            ending.join(_WITHIN_S)
            self._thread.join(_WITHIN_S)
        self._server.server_close()


class _Server(HTTPServer):
    request_queue_size = 4
    _connection: socket.socket | None = None  # that is served
    _ends = False

    def finish_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection; a client that sends or reads slowly is cut off."""
        timer = threading.Timer(_WITHIN_S, _cut, (request,))
        timer.daemon = True
        self._connection = request
        timer.start()
        if self._ends:  # it came too late to be cut off
            _cut(request)
        try:
            super().finish_request(request, client_address)
        finally:
            timer.cancel()
            self._connection = None

    def cut(self) -> None:
        """End the connection that is served, and those that still come."""
        self._ends = True
        connection = self._connection
        if connection is not None:
            _cut(connection)

    def handle_error(self, *_: object) -> None:
        """Ignore it: the other end went away."""


def _cut(connection: socket.socket) -> None:
    with suppress(OSError):  # it has just ended by itself
        connection.shutdown(socket.SHUT_RDWR)
