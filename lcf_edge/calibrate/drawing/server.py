"""Serves the page that own parts are drawn on, until what was drawn can be used.

The page asks for ``/state``, and for ``/image`` when there is a new one. ``/check`` answers with the lines of the
configuration that a drawing makes, or why it cannot be used; ``/save`` takes it, and ends the server. All need the
token of the address: who could save something else would decide what the vehicle does not see.
"""

import asyncio
from collections.abc import Sequence

import cv2
import msgspec
from aiohttp import web

from lcf_edge.calibrate import config_file
from lcf_edge.calibrate.drawing.watcher import Watcher
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.mask import Grey, Polygon, as_result
from lcf_edge.calibrate.result import Result
from lcf_edge.calibrate.sources import SensorSource
from lcf_edge.config import Config
from lcf_edge.corners import own_parts
from lcf_edge.errors import ConfigError
from lcf_edge.printable import counted
from lcf_edge.web.doorkeeper import Doorkeeper
from lcf_edge.web.guard import Guard
from lcf_edge.web.serving import Place, add_page, serve_at

MAX_DRAWING_BYTES = 2**19  # the largest mask, written at length, has about 2^18
JPEG_QUALITY = 90

_COMMAND = "calibrate mask"


class Drawing(msgspec.Struct, forbid_unknown_fields=True):
    """What the page sends: polygons of x, y in px of its image."""

    polygons: list[list[tuple[float, float]]]


def drawn_mask(
    source: SensorSource, config: Config, polygons: Sequence[Polygon], seconds: float | None, port: int, guide: Guide
) -> Result:
    """``camera.mask`` as drawn on the page.

    ``polygons``: drawn already, px of the source's images; none: those of ``config``. ``seconds``: what the proposal is
    made of; None: 30 s, or a whole recording. Raises ``LcfError``, ``DriverError``.
    """
    watcher = Watcher(source, seconds)
    try:
        watcher.start()
        return asyncio.run(_drawn(Server(watcher, config, polygons), port, guide))
    finally:
        watcher.close()


async def _drawn(server: "Server", port: int, guide: Guide) -> Result:
    """Raises ``LcfError``."""
    place = Place("127.0.0.1", port, _COMMAND, "--port N", is_private=True)
    await serve_at(place, server.application, server.ended, lambda address: guide.say(f"open {address} (Ctrl-C ends)"))
    assert server.result is not None  # nothing else ends it
    return server.result


class Server:
    """Serves the images of ``watcher``. ``result``: what was saved, once ``ended`` is set."""

    def __init__(self, watcher: Watcher, config: Config, polygons: Sequence[Polygon]) -> None:
        self.ended = asyncio.Event()
        self.result: Result | None = None
        self._watcher = watcher
        self._config = config
        height, width = watcher.watched().image.shape
        self._given = polygons or [each.tolist() for each in own_parts.polygons(config.camera, width, height)]

    def application(self, guard: Guard, door: Doorkeeper) -> web.Application:
        """Return the application with all routes."""
        application = web.Application(middlewares=[door.busy], client_max_size=MAX_DRAWING_BYTES)
        guard.protect(application)
        add_page(application, __package__)
        application.router.add_get("/state", self._state)
        application.router.add_get("/image", self._image)
        application.router.add_post("/check", self._check)
        application.router.add_post("/save", self._save)
        application.on_shutdown.append(door.end)
        return application

    async def _state(self, _: web.Request) -> web.Response:
        watched = self._watcher.watched()
        state = {
            "number": watched.number,
            "live": self._watcher.live,
            "measuring": watched.is_measuring,
            "note": watched.note,
            "given": self._given,
            "proposed": watched.proposed,
        }
        return web.Response(body=msgspec.json.encode(state), content_type="application/json")

    async def _image(self, _: web.Request) -> web.Response:
        body = await asyncio.to_thread(_jpeg, self._watcher.watched().image)
        return web.Response(body=body, content_type="image/jpeg")

    async def _check(self, request: web.Request) -> web.Response:
        result = await self._result(request)
        return web.Response(text=config_file.as_toml(result.table, result.values) + "\n")

    async def _save(self, request: web.Request) -> web.Response:
        self.result = await self._result(request)
        self.ended.set()
        return web.Response(status=204)

    async def _result(self, request: web.Request) -> Result:
        """Read a drawing; only JSON, which no form on another page can send. Raises ``HTTPException``."""
        if request.content_type != "application/json":
            raise web.HTTPBadRequest(text="a drawing as JSON is required\n")
        try:
            drawing = msgspec.json.decode(await request.read(), type=Drawing)
            polygons = [[list(point) for point in polygon] for polygon in drawing.polygons]
            finding = f"{counted(len(polygons), 'own part')}, as drawn"
            return as_result(polygons, self._watcher.watched().image, self._config, finding, "drawn")
        except msgspec.DecodeError:
            raise web.HTTPBadRequest(text="no drawing: lists of [x, y] are required\n") from None
        except ConfigError as error:
            raise web.HTTPBadRequest(text=f"{error}\n") from None


def _jpeg(image: Grey) -> bytes:
    _, data = cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))
    return data.tobytes()
