"""A session is open on loopback only, unless the configuration says more, and says in one line why it is not."""

import os
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from lcf_edge.config import Zenoh
from lcf_edge.errors import PublishError
from lcf_edge.zenoh_link import close_session, open_session, opened_session


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (Zenoh(listen=["nonsense"]), "nonsense"),
        (Zenoh(listen=["bogus/1"]), "bogus/1: Unicast not supported for bogus protocol"),
        (Zenoh(listen=["tcp/127.0.0.1:0#="]), "zenoh.listen: tcp/127.0.0.1:0: what follows ? or # cannot be read"),
        (Zenoh(listen=["tcp/127.0.0.1:99999"]), "tcp/127.0.0.1:99999: invalid port"),
        (
            Zenoh(mode="client", connect=["tcp/127.0.0.1:9"], listen=[]),
            "tcp/127.0.0.1:9: nobody answers; start the router first",
        ),
        (Zenoh(config_file="/nowhere.json5"), "/nowhere.json5: no valid Zenoh configuration"),
    ],
)
def test_a_session_that_cannot_be_opened_is_one_line(options: Zenoh, text: str) -> None:
    with pytest.raises(PublishError) as caught:
        open_session(options)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "cargo" not in str(caught.value)


@pytest.mark.parametrize(
    "options",
    [
        Zenoh(listen=["tls/127.0.0.1:0#listen_private_key_base64=SECRET;listen_certificate_base64=SECRET"]),
        Zenoh(listen=["tcp/127.0.0.1:0#iface=SECRET"]),
        Zenoh(mode="client", connect=["tls/127.0.0.1:9#connect_private_key_base64=SECRET"], listen=[]),
    ],
)
def test_what_an_endpoint_carries_is_not_reported(options: Zenoh) -> None:
    with pytest.raises(PublishError) as caught:
        open_session(options)
    assert "SECRET" not in str(caught.value)
    assert str(caught.value).startswith(tuple(one.partition("#")[0] for one in options.listen + options.connect))


def listening_addresses(options: Zenoh) -> tuple[set[str], set[str]]:
    """Local addresses of the TCP listeners and of the UDP sockets of a process that opens such a session."""
    code = (
        "import sys, msgspec, pathlib, os, glob\n"
        "from lcf_edge.config import Zenoh\n"
        "from lcf_edge.zenoh_link import open_session\n"
        "with open_session(msgspec.json.decode(sys.argv[1], type=Zenoh)):\n"
        "    links = {os.readlink(f) for f in glob.glob('/proc/self/fd/*') if os.path.islink(f)}\n"
        "    for name in ('tcp', 'tcp6', 'udp', 'udp6'):\n"
        "        for row in pathlib.Path('/proc/net', name).read_text().splitlines()[1:]:\n"
        "            part = row.split()\n"
        "            if f'socket:[{part[9]}]' in links: print(name[:3], part[1])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, msgspec.json.encode(options).decode()],
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line.split() for line in done.stdout.splitlines()]
    return {at for name, at in rows if name == "tcp"}, {at for name, at in rows if name == "udp"}


needs_proc = pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads Linux's table of sockets")


@needs_proc
def test_by_default_only_loopback_listens_and_nobody_is_scouted(endpoint: str) -> None:
    tcp, udp = listening_addresses(Zenoh(listen=[endpoint]))
    port = int(endpoint.rpartition(":")[2])
    assert tcp == {f"0100007F:{port:04X}"}
    assert udp == set()


@needs_proc
def test_without_an_endpoint_nothing_listens() -> None:
    assert listening_addresses(Zenoh(listen=[])) == (set(), set())


@needs_proc
@pytest.mark.parametrize("mode", ["peer", "router"])
def test_with_a_configuration_file_that_names_no_endpoint_nothing_listens(tmp_path: Path, mode: str) -> None:
    """Zenoh itself would listen on all interfaces."""
    file = tmp_path / "zenoh.json5"
    file.write_text("{transport: {link: {tls: {enable_mtls: true}}}}")
    options = Zenoh(mode=mode, listen=[], config_file=str(file))  # type: ignore[arg-type]
    assert listening_addresses(options) == (set(), set())


@needs_proc
def test_a_configuration_file_is_heard_and_the_keys_go_on_top(tmp_path: Path, endpoint: str) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text(f'{{listen: {{endpoints: ["{endpoint}"]}}, mode: "router"}}')
    port = int(endpoint.rpartition(":")[2])
    tcp, udp = listening_addresses(Zenoh(config_file=os.fspath(file), listen=[]))
    assert tcp == {f"0100007F:{port:04X}"}, "an empty list leaves the file's"
    assert udp == set(), "what the file does not ask for stays off"
    other, _ = listening_addresses(Zenoh(config_file=os.fspath(file), listen=["tcp/127.0.0.1:0"]))
    assert other
    assert tcp.isdisjoint(other)


def test_the_end_of_a_session_is_the_end_of_its_context() -> None:
    with opened_session(Zenoh(listen=[])) as session:
        assert not session.is_closed()
    assert session.is_closed()


def test_a_session_may_be_closed_twice() -> None:
    session = open_session(Zenoh(listen=[]))
    assert close_session(session)
    assert close_session(session)
    assert session.is_closed()
