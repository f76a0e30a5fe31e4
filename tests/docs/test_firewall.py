"""The firewall's rules of docs/network.md: nft takes them, and in a network of its own they keep to what is said."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

RULES = (Path(__file__).parents[2] / "examples/network/nftables.conf").read_text(encoding="utf-8")
NFT = shutil.which("nft", path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")
OWN_NETWORK = ["unshare", "--net"] if os.getuid() == 0 else ["unshare", "--user", "--map-root-user", "--net"]

CONNECT = """
import errno, fcntl, socket, struct, subprocess, sys
rules, nft = sys.argv[1:]
with socket.socket() as one:  # loopback is down in a new network
    fcntl.ioctl(one, 0x8914, struct.pack("16sH", b"lo", 1))
subprocess.run([nft, "-f", rules], check=True)
server = socket.create_server(("127.0.0.1", 7447), backlog=100)
def connected(source):
    one = socket.socket()
    one.settimeout(0.3)
    one.bind((source, 0))
    try:
        one.connect(server.getsockname())
    except TimeoutError:
        return "dropped"
    except ConnectionRefusedError:
        return "refused"
    held.append(one)
    return "let in"
def from_inside(user):
    program = f"import os, socket; os.setuid({user}); socket.create_connection({inside.getsockname()!r}, 1)"
    return subprocess.run([sys.executable, "-c", program], stderr=subprocess.DEVNULL).returncode == 0
inside = socket.create_server(("127.0.0.1", 7448))
held = []
print(from_inside(0), from_inside(65534), sep=",")
print(connected("127.0.0.2"), *(connected("127.0.0.1") for _ in range(25)), sep=",")
"""


@pytest.fixture
def rules(tmp_path: Path) -> Path:
    """As they stand there, but for loopback and its only guest."""
    path = tmp_path / "rules.nft"
    text = RULES.replace('iifname != "lo"', 'iifname "lo"').replace("192.168.1.0/24", "127.0.0.1")
    text = text.replace('"lcf-edge-gate"', "0")  # which runs this test, and may be unknown here
    path.write_text(text)
    if NFT is None:
        pytest.skip("no nft here")
    if subprocess.run([*OWN_NETWORK, NFT, "list", "ruleset"], capture_output=True, check=False).returncode:
        pytest.skip("no network of its own here, or none that filters")
    return path


def test_nft_takes_the_rules(rules: Path) -> None:
    assert NFT
    done = subprocess.run([*OWN_NETWORK, NFT, "-c", "-f", rules], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_strangers_of_other_networks_are_dropped_and_neighbours_are_bounded(rules: Path) -> None:
    assert NFT
    command: list[str | Path] = [*OWN_NETWORK, sys.executable, "-c", CONNECT, rules, NFT]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    gate, outside = done.stdout.splitlines()
    stranger, *neighbour = outside.split(",")
    assert gate == "True,False", "at the daemon's own port: the gate, and somebody else"
    assert stranger == "dropped"
    assert neighbour == ["let in"] * 16 + ["refused"] * 9
