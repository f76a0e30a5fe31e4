"""Who is let in, what they receive, and what is saved: the real server over real HTTP."""

import asyncio
import json
import resource
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Coroutine, Iterator
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import numpy as np
import pytest
from aiohttp import web
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lcf_edge.cli.command_line import main
from lcf_edge.daemon.log import AT_ONCE
from lcf_edge.messages import CIRCLE
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.web import server
from lcf_edge.web.doorkeeper import Doorkeeper
from lcf_edge.web.guard import Guard

PATIENCE_S = 30.0


def ask(address: str, path: str = "/", **headers: str) -> HTTPResponse:
    """One answer, with its body read into ``body``."""
    parts = urlsplit(address)
    connection = HTTPConnection(parts.hostname or "", parts.port, timeout=PATIENCE_S)
    connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    answer.body = answer.read()  # type: ignore[attr-defined]
    connection.close()
    return answer


def updates(address: str, work: Callable[[aiohttp.ClientWebSocketResponse], Coroutine[Any, Any, Any]]) -> Any:
    """Do ``work`` with a socket of updates."""

    async def connected() -> Any:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{address}updates", max_msg_size=0) as socket,
        ):
            return await asyncio.wait_for(work(socket), PATIENCE_S)

    return asyncio.run(connected())


async def update(socket: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
    """Ask for one, with its image if there is one."""
    await socket.send_str("next")
    latest: dict[str, Any] = json.loads(await socket.receive_str())
    if "picture" in latest:
        latest["jpeg"] = await socket.receive_bytes()
    return latest


async def until(socket: aiohttp.ClientWebSocketResponse, known: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    latest = await update(socket)
    while not known(latest):
        latest = await update(socket)
    return latest


@pytest.fixture(scope="module")
def lonely(serving: Any) -> Iterator[str]:
    """The address of a server whose rover never comes."""
    served = serving("tcp/127.0.0.1:1")
    yield served.address
    assert served.end() == (0, "")


SCRIPTS = sorted(file.name for file in Path(server.__file__).parent.glob("page/*.js"))


def test_the_page_and_all_that_it_needs_is_sent_with_a_strict_policy(lonely: str) -> None:
    for name in ("", "base.css", "page.css", *SCRIPTS, "icon.svg"):
        answer: Any = ask(lonely, f"/{name}")
        assert answer.status == 200
        policy = answer.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert b"http://" not in answer.body.replace(b"http://www.w3.org/2000/svg", b"")  # nothing from elsewhere
        assert b"https://" not in answer.body
    missing = ask(lonely, "/../server.py")
    assert missing.status == 404
    assert missing.headers["X-Frame-Options"] == "DENY"


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "localhost:9000"}, 200),  # through a tunnel
        ({"Host": "[::1]:80"}, 200),
        ({"Host": "evil.example"}, 403),  # a name that was pointed here
        ({"Host": "127.0.0.1.evil.example"}, 403),
        ({"Host": "192.168.1.7"}, 403),
        ({"Host": "[::"}, 403),
        ({"Host": ""}, 403),
        ({"Host": "evil.example#@127.0.0.1"}, 403),
        ({"Host": "localhost.evil.example"}, 403),
        ({"Host": "2130706433"}, 403),
        ({"Host": "a" * 7000}, 403),
        ({"Host": "localhost", "Origin": "http://localhost"}, 200),
        ({"Host": "localhost", "Origin": "http://evil.example"}, 403),
        ({"Host": "localhost", "Origin": "null"}, 403),
    ],
)
def test_on_loopback_only_this_machine_is_let_in(lonely: str, headers: dict[str, str], status: int) -> None:
    assert ask(lonely, "/", **headers).status == status
    assert ask(lonely, "/updates", **headers).status == (400 if status == 200 else 403)  # 400: not a WebSocket


def test_on_the_network_the_token_is_asked_for(view: Callable[..., Any]) -> None:
    served = view("--listen", "0.0.0.0")
    parts = urlsplit(served.address)
    token = parts.query.removeprefix("token=")
    assert len(token) >= 32
    address = f"http://127.0.0.1:{parts.port}"
    for path in ("/", "/updates", "/save", "/page.js", "/?token=", f"/?token={token[:-1]}", "/?token=%C3%A4%00"):
        refused = ask(address, path)
        assert (refused.status, refused.headers["Set-Cookie"]) == (403, None), path
    welcome = ask(address, f"/?token={token}")
    cookie = welcome.headers["Set-Cookie"]
    assert (welcome.status, welcome.headers["Location"]) == (303, "/")  # the token leaves the address
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert ask(address, "/", Cookie=cookie.split(";")[0]).status == 200
    assert ask(address, "/", Cookie=cookie.split(";")[0], Origin="http://evil.example").status == 403
    assert ask(address, "/page.js", Cookie=cookie.split(";")[0][:-1]).status == 403
    assert ask(address, f"/save?token={token}").status == 404  # let in; there is nothing to save


def test_updates_contain_all_and_images_are_drawn_only_meanwhile(seen: tuple[Any, Any]) -> None:
    rover, served = seen

    async def look(socket: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
        first = await until(socket, lambda latest: latest.get("status"))
        assert [one["level"] for one in first["status"]] == ["ok", "error", "ok", "ok"]
        return await until(socket, lambda latest: latest.get("picture", {}).get("scene"))

    rover.wait_for(lambda: rover.unseen > 20)
    latest = updates(served.address, look)
    assert latest["connection"]["presence"] == "there"
    assert latest["connection"]["robots"] == ["rover"]
    assert len(latest["scene"]["circles"]) == 5
    assert latest["jpeg"].startswith(b"\xff\xd8\xff")
    assert latest["picture"]["scene"]["psi"][1]["shape"] == "rect"
    rover.wait_for(lambda: rover.unseen > 20)  # nobody looks any more


def test_a_browser_that_is_slow_gets_the_newest_not_all(seen: tuple[Any, Any]) -> None:
    rover, served = seen

    async def look(socket: aiohttp.ClientWebSocketResponse) -> None:
        first = (await until(socket, lambda latest: latest["scene"]))["scene"]["seq"]
        await asyncio.to_thread(rover.wait_for, lambda: rover.seq > first + 20)
        assert (await update(socket))["scene"]["seq"] > first + 15

    updates(served.address, look)


def test_what_is_no_question_ends_the_socket(lonely: str) -> None:
    async def send(browser: aiohttp.ClientWebSocketResponse) -> aiohttp.WSMsgType:
        await browser.send_str("x" * 10_000)
        return (await browser.receive()).type

    assert updates(lonely, send) is aiohttp.WSMsgType.CLOSE


@pytest.mark.parametrize(
    "data", [b"garbage\r\n\r\n", b"GET / HTTP/1.1\r\nContent-Length: x\r\n\r\n", b"\x16\x03\x01\x02\x00"]
)
def test_what_is_no_http_is_refused_in_silence(lonely: str, data: bytes) -> None:
    parts = urlsplit(lonely)
    with socket.create_connection((parts.hostname, parts.port), PATIENCE_S) as connection:
        connection.sendall(data + b"\r\n\r\n")
        assert b" 400 " in connection.recv(100)


UPGRADE = (
    "GET /updates HTTP/1.1\r\nHost: {}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n{}\r\n"
)


def closing(address: str, data: bytes) -> bytes:
    """The last frame that a socket of updates sends to who has sent this."""
    parts = urlsplit(address)
    with socket.create_connection((parts.hostname, parts.port), PATIENCE_S) as browser:
        browser.sendall(UPGRADE.format(parts.netloc, "").encode() + data)
        return b"".join(iter(lambda: browser.recv(4096), b""))[-4:]


@pytest.mark.parametrize(
    ("frames", "code"),
    [
        (b"\x81\xfe\xff\xff" + bytes(4 + 65535), 1009),  # longer than any question
        (b"\x81\xff" + b"\xff" * 8 + bytes(4), 1009),  # that long, and nothing of it comes
        (b"\x81\xff\x40" + bytes(7 + 4), 1009),
        (b"\x01\x81\0\0\0\0a" + b"\x00\x81\0\0\0\0a" * 1000, 1009),  # in pieces
        (b"\x01\x81\0\0\0\0a" * 2, 1002),  # a piece of two
        (b"\x80\x80\0\0\0\0", 1002),  # the rest of nothing
        (b"\x09\x80\0\0\0\0", 1002),  # a ping in pieces
        (b"\x89\xfe\x10\0\0\0\0\0" + bytes(4096), 1002),  # a large ping
        (b"\x83\x80\0\0\0\0", 1002),  # no kind that is known
        (b"\xc1\x84\0\0\0\0next", 1002),  # packed, which was not agreed on
        (b"\x88\x81\0\0\0\0a", 1002),  # half a reason for the end
        (b"\x81\x84\0\0\0\0\xff\xfe\xfd\xfc", 1007),  # no text
    ],
)
def test_frames_that_are_wrong_end_the_socket(lonely: str, frames: bytes, code: int) -> None:
    assert closing(lonely, frames) == b"\x88\x02" + code.to_bytes(2)
    assert ask(lonely).status == 200


def test_who_sends_pings_without_end_is_let_go(lonely: str) -> None:
    assert closing(lonely, b"\x89\x80\0\0\0\0" * 20_000)


def test_there_is_room_for_so_many_browsers(lonely: str) -> None:

    async def crowd(_: aiohttp.ClientWebSocketResponse) -> int:
        async with aiohttp.ClientSession() as session:
            others = [await session.ws_connect(f"{lonely}updates") for _ in range(15)]
            async with session.get(f"{lonely}updates") as answer:
                status = answer.status
            for other in others:
                await other.close()
            return status

    assert updates(lonely, crowd) == 503


def test_the_last_seconds_are_saved_for_independent_readers(seen: tuple[Any, Any], tmp_path: Path) -> None:
    rover, served = seen

    async def look(socket: aiohttp.ClientWebSocketResponse) -> None:
        await until(socket, lambda latest: "jpeg" in latest and latest["scene"]["seq"] > 10)

    updates(served.address, look)
    answer: Any = ask(served.address, "/save")
    assert answer.headers["Content-Disposition"].endswith('.mcap"')
    (tmp_path / "saved.mcap").write_bytes(answer.body)
    with (tmp_path / "saved.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        read = [(schema, channel.topic, message) for schema, channel, message in reader.iter_messages()]
    times_ns = [message.log_time for _, _, message in read]
    assert times_ns == sorted(times_ns)
    assert abs(times_ns[-1] - time.time_ns()) < PATIENCE_S * 1e9
    decoded = {}
    for topic, (schema, message) in {topic: (schema, message) for schema, topic, message in read}.items():
        ros = get_typestore(Stores.EMPTY)
        ros.register(get_types_from_msg(schema.data.decode(), schema.name))
        decoded[topic] = ros.deserialize_cdr(message.data, schema.name)
    assert set(decoded) == {"/lcf/scene", "/lcf/diagnostics", "/lcf/preview/compressed", "/lcf/annotations"}
    assert "cutting in" in {text.text for text in decoded["/lcf/annotations"].texts}
    assert decoded["/lcf/scene"].circles[3].ttc == 1.25
    assert decoded["/lcf/preview/compressed"].format == "jpeg"
    assert [status.name for status in decoded["/lcf/diagnostics"].status] == [one.name for one in rover.status]


def test_with_nothing_to_save_it_says_so(lonely: str) -> None:
    answer: Any = ask(lonely, "/save")
    assert (answer.status, answer.body) == (404, b"nothing arrived in the last seconds: there is nothing to save\n")


def deaf(address: str) -> socket.socket:
    """A browser that asks for update after update and reads none of them."""
    parts = urlsplit(address)
    browser = socket.socket()
    browser.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    browser.connect((parts.hostname, parts.port))
    browser.sendall(
        f"GET /updates HTTP/1.1\r\nHost: {parts.netloc}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    browser.sendall(b"\x81\x84\0\0\0\0next" * 100)  # masked with zeros
    return browser


def test_a_signal_ends_it_while_somebody_takes_nothing(rover: Any, view: Callable[..., Any]) -> None:
    rover.circles = np.zeros(15_000, CIRCLE)  # a few updates fill what lies between the two
    served = view()
    with deaf(served.address):
        rover.wait_for(lambda: rover.previews > 20)
        assert served.end() == (0, "")


def test_who_takes_nothing_is_let_go(rover: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "SILENCE_S", 1.0)
    rover.circles = np.zeros(15_000, CIRCLE)

    async def look() -> None:
        serving = server.Server(DaemonAddress(rover.endpoint))
        runner = web.AppRunner(serving.application(Guard("127.0.0.1"), Doorkeeper()))
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        with deaf(f"http://127.0.0.1:{runner.addresses[0][1]}/"):
            await asyncio.to_thread(rover.wait_for, lambda: rover.previews)
            await asyncio.to_thread(rover.wait_for, lambda: rover.unseen > 20)
        await runner.cleanup()
        serving.close()

    asyncio.run(look())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_while_somebody_looks(rover: Any, view: Callable[..., Any], number: signal.Signals) -> None:
    served = view()

    async def look(socket: aiohttp.ClientWebSocketResponse) -> aiohttp.WSMsgType:
        await until(socket, lambda latest: latest["scene"])
        served.process.send_signal(number)
        return (await socket.receive()).type

    assert updates(served.address, look) is aiohttp.WSMsgType.CLOSE
    assert served.process.wait(PATIENCE_S) == 0
    assert rover.link.counts["scene sent"] > 0


@pytest.mark.parametrize(
    ("arguments", "status", "part"),
    [
        (["--listen", "192.0.2.1"], 1, "view: 192.0.2.1:8088: cannot listen"),
        (["--port", "70000"], 2, "--port: 70000"),
        (["--port", "x"], 2, "--port: x"),
        (["--connect", "nonsense"], 1, "nonsense"),
    ],
)
def test_what_cannot_be_served_ends_in_one_line(
    capsys: pytest.CaptureFixture[str], arguments: list[str], status: int, part: str
) -> None:
    assert main(["view", *arguments]) == status
    (line,) = capsys.readouterr().err.splitlines()
    assert part in line


def test_a_port_in_use(lonely: str, capsys: pytest.CaptureFixture[str]) -> None:
    port = str(urlsplit(lonely).port)
    assert main(["view", "--port", port]) == 1
    assert f"127.0.0.1:{port}: cannot listen (Address already in use)" in capsys.readouterr().err


def test_without_the_library_it_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    assert main(["view"]) == 1
    assert capsys.readouterr().err == "lcf-edge: view: aiohttp is missing; run pip install 'lcf-edge[view]'\n"


# Who keeps connections without asking for anything.

HALF = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "


@pytest.fixture
def poor(endpoint: str, serving: Any) -> Iterator[Any]:
    """A server with 256 descriptors."""
    served = serving(endpoint)
    resource.prlimit(served.process.pid, resource.RLIMIT_NOFILE, (256, 256))
    yield served
    served.process.kill()
    served.process.communicate()


def test_half_sent_requests_do_not_keep_a_browser_out(poor: Any) -> None:
    parts = urlsplit(poor.address)
    held = []
    for _ in range(365):
        held.append(socket.create_connection((parts.hostname or "", parts.port or 0), PATIENCE_S))
        held[-1].sendall(HALF)
    for _ in range(3):
        assert ask(poor.address).status == 200
    assert len(list(Path(f"/proc/{poor.process.pid}/fd").iterdir())) < 200
    for one in held:
        one.close()
    status, said = poor.end()
    assert status == 0
    assert "Traceback" not in said
    assert 1 <= len(said.splitlines()) <= 12
    assert "connections" in said


def test_who_asks_for_nothing_is_let_go(lonely: str) -> None:
    parts = urlsplit(lonely)
    for sent in (b"", HALF):
        with socket.create_connection((parts.hostname or "", parts.port or 0), PATIENCE_S) as slow:
            slow.sendall(sent)
            assert slow.recv(100) == b""


def test_a_browser_that_looks_is_not_let_go_for_those_who_wait(poor: Any) -> None:
    parts = urlsplit(poor.address)

    async def look(socket_: aiohttp.ClientWebSocketResponse) -> None:
        await update(socket_)
        held = [await asyncio.open_connection(parts.hostname, parts.port) for _ in range(150)]
        assert (await update(socket_))["connection"]
        for _, writer in held:
            writer.close()

    updates(poor.address, look)


def test_saves_that_are_given_up_are_no_errors(seen: tuple[Any, Any]) -> None:
    _, view = seen
    parts = urlsplit(view.address)
    for _ in range(30):
        with socket.create_connection((parts.hostname or "", parts.port or 0), PATIENCE_S) as gone:
            gone.sendall(b"GET /save HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    assert ask(view.address).status == 200


def test_a_request_that_ends_just_as_the_server_gives_it_up_is_no_error(
    endpoint: str, caplog: pytest.LogCaptureFixture
) -> None:
    async def serve_one() -> None:
        loop, asked, done = asyncio.get_running_loop(), asyncio.Event(), asyncio.Event()

        async def slow(_: web.Request) -> web.Response:
            asked.set()
            await done.wait()
            return web.Response()

        async def stall(_: web.Application) -> None:
            """Let the request end in the same turn of the loop in which the time of ``shutdown_timeout`` is up."""
            up_s = loop.time() + 0.3
            loop.call_at(up_s - 0.1, time.sleep, 0.3)
            loop.call_at(up_s - 0.05, done.set)

        serving = server.Server(DaemonAddress(endpoint))
        application = serving.application(Guard("127.0.0.1"), Doorkeeper())
        application.router.add_get("/slow", slow)
        application.on_shutdown.append(stall)
        runner = web.AppRunner(application, shutdown_timeout=0.3)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        port = runner.addresses[0][1]
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"GET /slow HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        await asked.wait()
        await runner.cleanup()
        writer.close()
        serving.close()

    asyncio.run(serve_one())
    assert not [record.exc_info for record in caplog.records]


def test_what_a_stranger_writes_into_the_log_is_short(endpoint: str, serving: Any) -> None:
    served = serving(endpoint)
    parts = urlsplit(served.address)
    with socket.create_connection((parts.hostname, parts.port), PATIENCE_S) as browser:
        browser.sendall(UPGRADE.format(parts.netloc, f"Sec-WebSocket-Protocol: {'a,' * 3000}\r\n").encode())
        assert b" 101 " in browser.recv(100)
    status, said = served.end()
    assert status == 0
    (line,) = said.splitlines()
    assert len(line) < 400


NOISY = """
import asyncio, logging, os, signal, sys
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.web.server import serve

def complain(_):
    for name in ("asyncio", "aiohttp.server"):
        for _ in range(100):
            logging.getLogger(name).warning("socket.send() raised exception.")
    os.kill(os.getpid(), signal.SIGTERM)

asyncio.run(serve(DaemonAddress(sys.argv[1]), "127.0.0.1", 0, complain))
"""


def test_what_libraries_complain_of_when_a_save_is_given_up_is_limited(endpoint: str) -> None:
    done = subprocess.run([sys.executable, "-c", NOISY, endpoint], check=True, capture_output=True, text=True)
    assert done.stderr.splitlines() == ["lcf-edge: warning: view: socket.send() raised exception."] * AT_ONCE
