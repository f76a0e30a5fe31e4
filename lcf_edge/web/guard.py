"""Access control: only this machine, or whoever knows the token.

On loopback every request must name a loopback host, so that no web page can point a name of its own here (DNS
rebinding). Opened to the network, a request must bring the token instead, which no such page knows; on loopback it must
bring it as well where other users of this machine are to be kept out. In all cases the Origin of a request, if it has
one, must be the page's own.
"""

import hmac
import ipaddress
import secrets
from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

from aiohttp import web

TOKEN = "token"
_LOOPBACK_NAMES = frozenset({"localhost", "ip6-localhost"})
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-store",
    "Server": "lcf-edge",
}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Guard:
    """Lets requests through or refuses them. ``token``: None where being on this machine is enough."""

    def __init__(self, host: str, *, is_private: bool = False) -> None:
        self._is_local = is_loopback(host)
        self.token = None if self._is_local and not is_private else secrets.token_urlsafe(24)

    def protect(self, application: web.Application) -> None:
        """Check every request to ``application``."""

        @web.middleware
        async def guarded(request: web.Request, handler: Handler) -> web.StreamResponse:
            return self._refusal(request) or self._welcome(request) or await handler(request)

        application.middlewares.append(guarded)
        application.on_response_prepare.append(_add_headers)

    def _refusal(self, request: web.Request) -> web.Response | None:
        """Return the answer to a request that is refused; None: it is allowed."""
        if not all(value.isascii() for name, value in request.headers.items() if name != "Cookie"):
            return web.Response(status=400, text="a header that is not ASCII\n")  # aiohttp would fail on some of them
        if self._is_local and not is_loopback(_name(request.host)):
            return web.Response(status=403, text=f"{request.host} is not this machine; use http://127.0.0.1\n")
        if request.headers.get("Origin", f"//{request.host}").partition("//")[2] != request.host:
            return web.Response(status=403, text="requests from other pages are refused\n")
        if self.token is None:
            return None
        brought = request.query.get(TOKEN) or request.cookies.get(_cookie(request), "")
        if not hmac.compare_digest(brought.encode(errors="replace"), self.token.encode()):
            return web.Response(status=403, text="open the address that lcf-edge printed when it started\n")
        return None

    def _welcome(self, request: web.Request) -> web.Response | None:
        """Move the token from the address into a cookie."""
        if self.token is None or TOKEN not in request.query or request.path != "/":
            return None
        response = web.Response(status=303, headers={"Location": "/"})
        response.set_cookie(_cookie(request), self.token, httponly=True, samesite="Strict")
        return response


def is_loopback(host: str) -> bool:
    """Whether the host can only be this machine."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() in _LOOPBACK_NAMES


def _cookie(request: web.Request) -> str:
    """Return a name of the cookie for each port: cookies ignore ports."""
    place = request.transport.get_extra_info("sockname") if request.transport else None
    return f"lcf_edge_view_{place[1] if place else 0}"


def _name(host: str) -> str:
    """Return the host name without port; empty: invalid."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    response.headers.update(_HEADERS)
