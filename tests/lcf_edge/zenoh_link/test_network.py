"""The network is reached as docs/network.md says: with certificates, and by those alone whom a rule names."""

import re
import resource
import socket
import ssl
import struct
import subprocess
import sys
import threading
import time
import tomllib
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from lcf_edge.config import Config, Zenoh
from lcf_edge.gate.entrances import HANDSHAKE_S, MAX_OF_ONE_NAME
from lcf_edge.gate.gate import MAX_STRANGERS
from lcf_edge.messages import Scene
from lcf_edge.zenoh_link import opened_session
from lcf_edge.zenoh_link.link import Link

ROOT = Path(__file__).parents[3]
DOCUMENT = (ROOT / "docs/network.md").read_text(encoding="utf-8")
EXAMPLES = ROOT / "examples/network"
PATIENCE = 20  # silences in which what is sent arrives on a busy computer
SILENCE_S = 0.3
PATIENCE_S = 20.0

NewScene = Callable[..., Scene]
Velocity = Callable[..., bytes]


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", DOCUMENT, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The documented files, and the certificates that the documented script makes."""
    folder = tmp_path_factory.mktemp("tls")

    def certify(place: Path, *parties: str) -> None:
        script = ("sh", EXAMPLES / "certificates.sh", "rover", *parties)
        subprocess.run(script, cwd=place, check=True, capture_output=True)

    certify(folder, "planner", "wheels")
    certify(folder, "guest", "unknown")  # of the same authorities
    for file in (folder / "inner").glob("unknown.*"):
        file.unlink()
    other = tmp_path_factory.mktemp("other")
    certify(other, "stranger")
    for file in other.glob("stranger.*"):
        file.rename(folder / file.name)
    rover, reader = ((EXAMPLES / name).read_text(encoding="utf-8") for name in ("zenoh.json5", "planner.json5"))
    (folder / "zenoh.json5").write_text(rover.replace("/etc/lcf-edge/tls", str(folder)))
    (folder / "planner.json5").write_text(re.sub(r'"(\w+\.(pem|key))"', rf'"{folder}/\1"', reader))
    return folder


@pytest.fixture
def rover(folder: Path, endpoint: str) -> Iterator[zenoh.Session]:
    """A session with the documented configuration."""
    written = blocks("toml")[0]
    options = msgspec.convert(tomllib.loads(written)["zenoh"], Zenoh)
    assert options == Zenoh(listen=["tls/127.0.0.1:7448"], config_file="/etc/lcf-edge/zenoh.json5")
    file = str(folder / "zenoh.json5")
    with opened_session(Zenoh(listen=[endpoint.replace("tcp/", "tls/")], config_file=file)) as opened:
        yield opened


@pytest.fixture
def link(rover: zenoh.Session) -> Iterator[Link]:
    link = Link(rover, Config())
    yield link
    link.close()


def strict(folder: Path) -> ssl.SSLContext:
    """A client that takes no certificate which leaves something out, as every Python from 3.13 on does."""
    context = ssl.create_default_context(cafile=str(folder / "ca.pem"))
    context.verify_flags |= ssl.VERIFY_X509_STRICT
    return context


class Gate:
    """``lcf-edge gate`` as a process, before ``endpoint``. ``endpoint``: of its own."""

    def __init__(self, folder: Path, endpoint: str) -> None:
        command = ("gate", "--tls", folder, "--listen", "127.0.0.1", "--port", "0", "--to", endpoint.rpartition(":")[2])
        self.process = subprocess.Popen(
            [sys.executable, "-m", "lcf_edge", *map(str, command)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout
        self.first_line = self.process.stdout.readline()
        self.port = int(self.first_line.split()[0].rpartition(":")[2])
        self.endpoint = f"tls/localhost:{self.port}"

    @property
    def descriptors(self) -> int:
        return len(list(Path(f"/proc/{self.process.pid}/fd").iterdir()))

    @property
    def resident_mib(self) -> float:
        return int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]) * resource.getpagesize() / 2**20

    def until_told(self, what: str) -> bool:
        """Whether it says so in time; else it is ended."""
        assert self.process.stderr
        ending = threading.Timer(PATIENCE_S, self.process.terminate)
        ending.start()
        try:
            return any(what in line for line in self.process.stderr)
        finally:
            ending.cancel()

    def end(self) -> tuple[int, str]:
        """Exit status, and what it said since."""
        self.process.terminate()
        _, said = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, said


@pytest.fixture
def gate(folder: Path, endpoint: str) -> Iterator[Gate]:
    gate = Gate(folder, endpoint)
    yield gate
    status, said = gate.end()
    assert status == 0
    assert "Traceback" not in said


@pytest.fixture
def party(start: Any, folder: Path, gate: Gate) -> Callable[[str], Any]:
    """Somebody with a certificate."""

    def connect(name: str, **settings: Any) -> Any:
        where = gate.endpoint
        tls = {
            "transport__link__tls__root_ca_certificate": str(folder / "ca.pem"),
            "transport__link__tls__connect_certificate": str(folder / f"{name}.pem"),
            "transport__link__tls__connect_private_key": str(folder / f"{name}.key"),
            "transport__link__tls__enable_mtls": True,
        }
        return start(**({"mode": "peer", "listen__endpoints": [], "connect__endpoints": [where]} | tls | settings))

    return connect


def test_a_planner_reads_as_documented(
    link: Link, rover: zenoh.Session, until_matched: Any, folder: Path, gate: Gate, scene: Callable[..., Scene]
) -> None:
    (code,) = blocks("python")
    code = code.replace("tls/rover:7447", gate.endpoint)
    code = code.replace("planner.json5", str(folder / "planner.json5"))
    with subprocess.Popen((sys.executable, "-u", "-c", code), stdout=subprocess.PIPE, text=True) as planner:
        try:
            until_matched(rover, "lcf/scene")
            link.put_scene(scene(7))
            assert planner.stdout
            assert planner.stdout.readline() == "7 3\n"
        finally:
            planner.kill()


def test_a_planner_reads_and_queries_but_does_not_send_the_speed(
    link: Link, rover: zenoh.Session, until_matched: Any, party: Any, scene: NewScene, velocity: Velocity
) -> None:
    planner = party("planner")
    planner.subscribe("lcf/scene")
    until_matched(rover, "lcf/scene")
    link.put_scene(scene())
    assert len(planner.receive("lcf/scene")) == 1
    assert planner.tokens("lcf/@alive/*") == ["lcf/@alive/rover"]
    assert len(planner.get("lcf/query/config")) == 1
    planner.ask("put_blindly", key="lcf/speed", payload=velocity().hex())
    assert len(planner.get("lcf/query/config")) == 1
    assert not any(name.startswith("speed") for name in link.counts)


def test_wheels_send_the_speed_but_do_not_read(
    link: Link, rover: zenoh.Session, until_matched: Any, party: Any, scene: NewScene, velocity: Velocity
) -> None:
    wheels, planner = party("wheels"), party("planner")
    wheels.subscribe("lcf/scene")
    wheels.put("lcf/speed", velocity())
    planner.subscribe("lcf/scene")
    until_matched(rover, "lcf/scene")
    link.put_scene(scene())
    assert len(planner.receive("lcf/scene")) == 1
    assert wheels.receive("lcf/scene", timeout_s=SILENCE_S) == []
    assert link.counts["speed taken"] == 1


@pytest.mark.parametrize("who", ["guest", "unknown", "stranger", "nobody"])
def test_whom_no_rule_names_does_nothing(
    link: Link, rover: zenoh.Session, until_matched: Any, party: Any, scene: NewScene, velocity: Velocity, who: str
) -> None:
    """With a certificate but without a rule, or unknown to the gate; of another authority; without a certificate."""
    nothing = {f"transport__link__tls__{key}": None for key in ("connect_certificate", "connect_private_key")}
    other = party(who) if who != "nobody" else party("guest", **nothing, transport__link__tls__enable_mtls=False)
    planner = party("planner")
    other.subscribe("lcf/scene")
    planner.subscribe("lcf/scene")
    until_matched(rover, "lcf/scene")
    other.ask("put_blindly", key="lcf/speed", payload=velocity().hex())
    link.put_scene(scene())
    assert len(planner.receive("lcf/scene")) == 1
    assert other.receive("lcf/scene", timeout_s=SILENCE_S) == []
    assert not any(name.startswith("speed") for name in link.counts)


# Every cell of the table in the document: who, on which key, does what.

KEYS = ("lcf/scene", "lcf/preview/compressed", "lcf/diagnostics", "lcf/query/config", "lcf/@alive/rover", "lcf/speed")
WHAT_IT_CALLS = {"receives", "asks", "sees", "sends"}
ROVER, ACTOR = b"of the rover", b"of the actor"


def documented(who: str) -> set[tuple[str, str]]:
    """What the table of the document allows somebody: key, action."""
    rows = [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in DOCUMENT.splitlines() if "|" in line]
    head = next(row for row in rows if row[0] == "key")
    allowed = {(row[0], row[head.index(who)]) for row in rows if row[0] in KEYS and len(row) == len(head)}
    assert {key for key, _ in allowed} == set(KEYS)
    assert {action for _, action in allowed} <= {*WHAT_IT_CALLS, "-"}
    return {cell for cell in allowed if cell[1] != "-"}


@pytest.fixture
def everything(rover: zenoh.Session) -> Iterator[list[tuple[str, str]]]:
    """What reaches the rover on whatever key; it publishes, answers and is alive on each."""
    came: list[tuple[str, str]] = []
    listening = [
        rover.declare_subscriber(key, lambda _, key=key: came.append((key, "sends")))  # type: ignore[misc]
        for key in KEYS
    ]
    answering = [
        rover.declare_queryable(key, lambda query, key=key: query.reply(key, ROVER))  # type: ignore[misc]
        for key in KEYS
    ]
    alive = [rover.liveliness().declare_token(key) for key in KEYS]
    yield came
    for one in (*listening, *answering, *alive):
        one.undeclare()  # type: ignore[no-untyped-call]


def payloads(samples: Iterable[Any]) -> set[bytes]:
    return {sample.payload for sample in samples if not isinstance(sample, str)}


@pytest.mark.parametrize("mode", ["peer", "client"])
@pytest.mark.parametrize("who", ["planner", "wheels", "anybody else"])
def test_each_does_what_the_table_says_and_nothing_else(
    rover: zenoh.Session, everything: list[tuple[str, str]], party: Any, who: str, mode: str
) -> None:
    """A client sends whether or not it has heard that somebody wants it, so the rover itself must refuse."""
    actor = party({"anybody else": "guest"}.get(who, who), mode=mode)
    witness = party("planner")
    assert actor.ask("connected")
    assert witness.ask("connected")
    for key in KEYS:
        witness.subscribe(key)
        actor.subscribe(key)
        actor.ask("answer", key=key, payload=ACTOR.hex())
        actor.ask("announce", key=key + "/of-the-actor")
    witness.get("lcf/query/config", SILENCE_S)  # what is asked is answered after what was declared
    actor.get("lcf/query/config", SILENCE_S)
    for key in KEYS:
        rover.put(key, ROVER, congestion_control=zenoh.CongestionControl.BLOCK)
    sent = {(key, action) for key, action in documented(who) if action == "sends"}
    done: set[tuple[str, str]] = set()
    for _ in range(PATIENCE):
        done |= {(key, "asks") for key in KEYS if ROVER in payloads(actor.get(key, SILENCE_S))}
        done |= {(key, "sees") for key in KEYS if key in actor.tokens(key)}
        done |= {(key, "receives") for key in KEYS if ROVER in payloads(actor.receive(key, 1, SILENCE_S))}
        if documented(who) - sent <= done:
            break
    everything.clear()  # of the rover itself
    for key in (key for key, action in documented(who) if action == "sends"):
        actor.put(key, ACTOR)  # once it has heard that somebody wants it
    for key in KEYS:
        actor.ask("put_blindly", key=key, payload=ACTOR.hex())
        actor.ask("delete", key=key)
    for _ in range(PATIENCE):
        actor.get("lcf/query/config", SILENCE_S)
        if sent <= set(everything):
            break
    done |= set(everything)
    assert done == documented(who)
    # Nothing of the actor's reaches the rover's questions, or another planner.
    answers = [one.ok.payload.to_bytes() for one in rover.get("lcf/**", timeout=SILENCE_S) if one.ok]
    tokens = [str(one.ok.key_expr) for one in rover.liveliness().get("lcf/**", timeout=SILENCE_S) if one.ok]
    assert set(answers) == {ROVER}
    assert not [token for token in tokens if token.endswith("of-the-actor")]
    assert witness.tokens("lcf/@alive/**") == ["lcf/@alive/rover"]
    assert payloads(one for key in KEYS for one in witness.get(key, SILENCE_S)) == {ROVER}
    assert payloads(one for key in KEYS for one in witness.receive(key, 9, SILENCE_S)) == {ROVER}


# Parties whose keys are too much for Zenoh.

WILD = [[f"**/{n}/**" for n in range(3000)]]
DEEP = [["/".join("a" * 40)], ["**/a/" * 10 + "b"]]
MAX_GROWN_MIB = 20.0


def is_answered(planner: Any, connects_s: float = 2.0) -> bool:
    """Whether it connects in time, and the daemon then answers it."""
    assert planner.ask("connected", timeout_s=connects_s)
    assert planner.ask("finds", key="lcf/query/config")
    return len(planner.get("lcf/query/config")) == 1


def resident_mib() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20


@pytest.mark.parametrize("offers", [WILD, DEEP], ids=["many-keys", "one-key"])
def test_a_party_whose_keys_are_too_much_is_cut_before_the_daemon_hears_of_them(
    link: Link, rover: zenoh.Session, gate: Gate, party: Any, offers: list[list[str]]
) -> None:
    assert link
    assert rover
    before_mib = resident_mib()
    for keys in offers:
        attacker = party("wheels", mode="client")
        assert attacker.ask("connected")
        attacker.ask("offer", keys=keys)
    assert gate.until_told("of wheels")
    assert is_answered(party("planner"), PATIENCE_S)
    assert resident_mib() < before_mib + MAX_GROWN_MIB


def test_a_party_that_says_much_keeps_no_other_out(link: Link, rover: zenoh.Session, party: Any) -> None:
    assert link
    assert rover
    talkers = [party("wheels", mode="client") for _ in range(6)]
    for talker in talkers:
        assert talker.ask("connected")
    for talker in talkers:
        talker.tell("put_forever", keys=["lcf/none"])
    for _ in range(3):
        assert is_answered(party("planner"))


def test_a_party_of_many_words_is_understood(link: Link, rover: zenoh.Session, party: Any, velocity: Velocity) -> None:
    """Everything that a session can say, in each mode."""
    assert rover
    for mode in ("client", "peer", "router"):
        talker = party("wheels", mode=mode)
        talker.ask("say_everything", key="lcf/speed", payload=velocity().hex())
        taken = link.counts["speed taken"]
        for _ in range(PATIENCE):
            talker.put("lcf/speed", velocity())
            talker.get("lcf/query/config", SILENCE_S)
            if link.counts["speed taken"] > taken:
                break
        assert link.counts["speed taken"] > taken


# Strangers at the gate.


class Strangers:
    """Hundreds that connect without a pause, send ``first`` and stay."""

    def __init__(self, port: int, first: bytes) -> None:
        self.came = 0
        self._port, self._first = port, first
        self._ends = threading.Event()
        self._held: deque[socket.socket] = deque(maxlen=300)
        self._thread = threading.Thread(target=self._come, name="strangers")
        self._thread.start()

    def _come(self) -> None:
        while not self._ends.wait(0.002):
            try:
                one = socket.create_connection(("127.0.0.1", self._port), PATIENCE_S)
                one.sendall(self._first)
            except ConnectionError:
                continue
            if len(self._held) == self._held.maxlen:
                self._held.popleft().close()
            self._held.append(one)
            self.came += 1

    def until(self, number: int) -> None:
        deadline_s = time.monotonic() + 10 * PATIENCE_S
        while self.came < number and time.monotonic() < deadline_s:
            self._ends.wait(0.01)
        assert self.came >= number

    def leave(self) -> None:
        self._ends.set()
        self._thread.join()
        for one in self._held:
            one.close()


@pytest.mark.parametrize("first", [b"", b"GET / HTTP/1.0\r\n\r\n", b"\x16\x03\x01\x02\x00\x01"])
def test_strangers_keep_no_planner_out_and_take_a_bounded_number_of_descriptors(
    link: Link, rover: zenoh.Session, gate: Gate, party: Any, first: bytes
) -> None:
    assert link
    before = len(list(Path("/proc/self/fd").iterdir()))
    strangers = Strangers(gate.port, first)
    try:
        strangers.until(400)
        for _ in range(3):
            assert is_answered(party("planner"))
        assert gate.descriptors < MAX_STRANGERS + 2 * 3 + 20
        assert gate.resident_mib < 80
    finally:
        strangers.leave()
    assert not rover.is_closed()
    mine = len(list(Path("/proc/self/fd").iterdir())) - before
    assert mine < 30, "nothing of theirs has reached the rover"


def handshake(gate: Gate, folder: Path, name: str) -> None:
    """Somebody with a certificate who says nothing after it."""
    context = strict(folder)
    context.load_cert_chain(folder / f"{name}.pem", folder / f"{name}.key")
    plain = socket.create_connection(("127.0.0.1", gate.port), PATIENCE_S)
    with suppress(OSError), context.wrap_socket(plain, server_hostname="localhost") as one:
        one.settimeout(PATIENCE_S)
        one.recv(1)


def slowly(gate: Gate) -> socket.socket:
    """A handshake that gives one byte and promises a record."""
    one = socket.create_connection(("127.0.0.1", gate.port), PATIENCE_S)
    one.sendall(b"\x16\x03\x01\x3f\xff")
    return one


def half_open(gate: Gate) -> socket.socket:
    """Says that nothing more comes, and listens."""
    one = socket.create_connection(("127.0.0.1", gate.port), PATIENCE_S)
    one.shutdown(socket.SHUT_WR)
    return one


def reset(gate: Gate) -> None:
    """Comes, and goes with a reset."""
    one = socket.create_connection(("127.0.0.1", gate.port), PATIENCE_S)
    one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    one.close()


def test_whoever_else_comes_a_planner_is_let_in(
    link: Link, rover: zenoh.Session, gate: Gate, party: Any, folder: Path
) -> None:
    assert link
    ends = threading.Event()
    came: Counter[str] = Counter()
    held: deque[socket.socket] = deque(maxlen=200)

    def come() -> None:
        while not ends.is_set():
            with suppress(OSError):
                handshake(gate, folder, "stranger")  # another authority's certificate
                handshake(gate, folder, "unknown")  # ours, of nobody whom the gate knows
                came["with a certificate"] += 2
                for _ in range(20):
                    reset(gate)
                    for one in (slowly(gate), half_open(gate)):
                        if len(held) == held.maxlen:
                            held.popleft().close()
                        held.append(one)
                came["others"] += 60

    crowd = threading.Thread(target=come, name="crowd")
    crowd.start()
    try:
        deadline_s = time.monotonic() + 10 * PATIENCE_S
        while came["others"] < 300 and time.monotonic() < deadline_s:
            ends.wait(0.01)
        for _ in range(3):
            planner = party("planner")
            assert planner.ask("connected", timeout_s=PATIENCE_S)
            assert any(planner.get("lcf/query/config") for _ in range(PATIENCE))
        assert gate.descriptors < MAX_STRANGERS + 2 * 3 + 20
        assert gate.resident_mib < 80
    finally:
        ends.set()
        crowd.join()
        for one in held:
            one.close()
    assert came["with a certificate"] >= 10
    assert not rover.is_closed()


def test_a_stranger_who_says_nothing_is_let_go(gate: Gate) -> None:
    with socket.create_connection(("127.0.0.1", gate.port), HANDSHAKE_S + PATIENCE_S) as silent:
        assert silent.recv(1) == b""


def test_a_party_may_have_so_many_connections_and_no_more(rover: zenoh.Session, gate: Gate, folder: Path) -> None:
    assert rover
    context = strict(folder)
    context.load_cert_chain(folder / "planner.pem", folder / "planner.key")
    held = []
    for _ in range(MAX_OF_ONE_NAME):
        plain = socket.create_connection(("127.0.0.1", gate.port), PATIENCE_S)
        held.append(context.wrap_socket(plain, server_hostname="localhost"))
    plain = socket.create_connection(("127.0.0.1", gate.port), PATIENCE_S)
    with context.wrap_socket(plain, server_hostname="localhost") as one_more:
        assert one_more.recv(1) == b""
    for one in held:
        one.close()


@pytest.mark.parametrize("who", ["unknown", "planner"])
def test_who_is_refused_with_a_certificate_takes_no_descriptor(gate: Gate, folder: Path, who: str) -> None:
    """Of no name that the gate knows, or while the daemon is away; none of them ever ends its connection."""
    context = strict(folder)
    context.load_cert_chain(folder / f"{who}.pem", folder / f"{who}.key")
    held = []
    for _ in range(30):
        plain = socket.create_connection(("127.0.0.1", gate.port), PATIENCE_S)
        held.append(context.wrap_socket(plain, server_hostname="localhost"))
        with suppress(ConnectionError):
            assert held[-1].recv(1) == b""
    assert gate.descriptors < 12  # 7 without anybody
    for one in held:
        one.close()


def test_a_gate_without_certificates_says_which_is_missing(tmp_path: Path) -> None:
    command = (sys.executable, "-m", "lcf_edge", "gate", "--tls", tmp_path)
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == (
        f"lcf-edge: {tmp_path}/rover.pem: cannot be used (No such file or directory); "
        "docs/network.md says how to make it\n"
    )
