"""Zenoh, for real: sessions, ports, processes that hold them, and a daemon that answers."""

import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from lcf_edge.config import Config, Zenoh
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.doctor import daemon, health, network
from lcf_edge.doctor.endpoints import Endpoint, parsed
from lcf_edge.doctor.finding import Context, Finding, Severity
from lcf_edge.doctor.processes import daemon_with, holders, listening, processes
from lcf_edge.zenoh_link.link import Link
from lcf_edge.zenoh_link.session import open_session

Machine = Callable[..., Context]
PROC = Path("/proc")


def bad(findings: list[Finding]) -> Finding:
    (found,) = [finding for finding in findings if finding.level is not Severity.OK]
    return found


# Endpoints.


@pytest.mark.parametrize(
    ("text", "endpoint", "local"),
    [
        ("tcp/127.0.0.1:7447", Endpoint("tcp", "127.0.0.1", 7447), True),
        ("tcp/[::1]:7447", Endpoint("tcp", "::1", 7447), True),
        ("tls/localhost:7447#verify=1", Endpoint("tls", "localhost", 7447), True),
        ("udp/0.0.0.0:7447?rel=0", Endpoint("udp", "0.0.0.0", 7447), False),
        ("tcp/[::]:7447", Endpoint("tcp", "::", 7447), False),
        ("quic/rover:1", Endpoint("quic", "rover", 1), False),
    ],
)
def test_an_endpoint_has_its_parts(text: str, endpoint: Endpoint, local: bool) -> None:
    assert parsed(text) == endpoint
    assert endpoint.local is local


def test_an_endpoint_without_a_port_has_none() -> None:
    assert parsed("unixsock-stream//run/lcf") is None


# Processes.


@pytest.fixture
def other(tmp_path: Path) -> Iterator[tuple[int, int]]:
    """A process that has ``tmp_path/device`` open and listens; its number and port."""
    (tmp_path / "device").touch()
    code = (
        "import socket, sys; f = open(sys.argv[1]); s = socket.socket(); s.bind(('127.0.0.1', 0)); s.listen()\n"
        "print(s.getsockname()[1], flush=True); sys.stdin.read()"
    )
    command = (sys.executable, "-c", code, str(tmp_path / "device"))
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        yield process.pid, int(process.stdout.readline())
        process.communicate()


def test_who_has_a_device_open_is_found(other: tuple[int, int], tmp_path: Path) -> None:
    (found,) = holders(tmp_path / "device", PROC)
    assert found.pid == other[0]
    assert not found.is_daemon
    assert holders(tmp_path / "another", PROC) == []


def test_who_listens_on_a_port_is_found(other: tuple[int, int]) -> None:
    pid, port = other
    found = listening(Endpoint("tcp", "127.0.0.1", port), PROC)
    assert found is not None
    assert found.pid == pid
    assert listening(Endpoint("udp", "127.0.0.1", port), PROC) is None


@pytest.mark.parametrize(
    ("words", "is_daemon"),
    [
        (("/opt/lcf-edge/bin/python", "/opt/lcf-edge/bin/lcf-edge", "run"), True),
        (("python3", "-m", "lcf_edge", "run", "-c", "x.toml"), True),
        (("/usr/bin/lcf-edge", "record", "drive.mcap"), True),
        (("/usr/bin/lcf-edge", "doctor"), False),
        (("vim", "lcf-edge", "README.md"), False),
        (("",), False),
    ],
)
def test_the_daemon_is_known_by_its_command(
    machine: Machine, process: Callable[..., None], words: tuple[str, ...], is_daemon: bool
) -> None:
    process(5, *words)
    assert [one.is_daemon for one in processes(machine().proc)] == [is_daemon]


def test_a_daemon_of_another_user_may_have_any_device(
    machine: Machine, process: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    process(5, "lcf-edge", "run", opened=("/dev/video0",))
    proc = machine().proc
    assert daemon_with(Path("/dev/video0"), proc) is not None
    assert daemon_with(Path("/dev/video1"), proc) is None

    def forbidden(_: Path) -> Iterator[Path]:
        raise PermissionError

    monkeypatch.setattr(Path, "iterdir", forbidden)  # root may look into every process
    assert daemon_with(Path("/dev/video1"), proc) is not None


# Ports and exposure.


def test_a_free_port_and_loopback_only_are_good(machine: Machine, endpoint: str) -> None:
    found = list(network.check(machine(Config(zenoh=Zenoh(listen=[endpoint])))))
    assert [(finding.level, finding.text) for finding in found] == [
        (Severity.OK, f"Zenoh opens as peer, listens on {endpoint}"),
        (Severity.OK, "only this computer can reach it"),
    ]


def test_a_port_that_is_taken_names_the_program(machine: Machine, other: tuple[int, int]) -> None:
    pid, port = other
    found = bad(list(network.check(machine(Config(zenoh=Zenoh(listen=[f"tcp/0.0.0.0:{port}"])), proc=PROC)))[:1])
    assert found.level is Severity.FAIL
    assert found.text.endswith(f", process {pid}")
    assert found.remedy.startswith(f"kill {pid} ")


def test_a_port_of_a_program_that_may_not_be_known(machine: Machine, other: tuple[int, int]) -> None:
    found = bad(list(network.check(machine(Config(zenoh=Zenoh(listen=[f"tcp/127.0.0.1:{other[1]}"]))))))
    assert found.remedy == f"sudo ss -ltnp 'sport = :{other[1]}'"


def test_a_neighbour_that_cannot_be_reached_is_reported(
    machine: Machine, endpoint: str, other: tuple[int, int]
) -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))  # but it does not listen
        away = f"tcp/127.0.0.1:{silent.getsockname()[1]}"
        there = f"tcp/127.0.0.1:{other[1]}"
        found = list(network.check(machine(Config(zenoh=Zenoh(listen=[endpoint], connect=[away, there])))))
    assert bad(found).text == f"{away}: cannot be reached"
    assert found[-1].text == f"{there}: somebody listens there"


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (Zenoh(listen=["rubbish"]), "zenoh.listen: rubbish: "),
        (Zenoh(config_file="/no/such.json5", listen=["tcp/127.0.0.1:0"]), "/no/such.json5: no valid Zenoh"),
    ],
)
def test_a_session_that_does_not_open_fails(machine: Machine, options: Zenoh, text: str) -> None:
    found = bad(list(network.check(machine(Config(zenoh=options)))))
    assert found.level is Severity.FAIL
    assert found.text.startswith(text)


def test_an_open_port_without_encryption_is_warned_of(machine: Machine) -> None:
    found = bad(list(network.exposed(machine(), Zenoh(listen=["tcp/127.0.0.1:7447", "tcp/0.0.0.0:7448"]))))
    assert found.level is Severity.WARN
    assert found.text.startswith("tcp/0.0.0.0:7448: anyone who reaches this port can read every scene")
    assert "docs/network.md" in found.text


@pytest.mark.parametrize(("mutual", "text"), [("true", "lcf-edge gate"), ("false", "enable_mtls")])
def test_encryption_wants_certificates_of_both_and_the_gate(
    machine: Machine, tmp_path: Path, mutual: str, text: str
) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text(f"{{transport: {{link: {{tls: {{enable_mtls: {mutual}}}}}}}}}")
    (found,) = network.exposed(machine(), Zenoh(listen=["tls/0.0.0.0:7447"], config_file=str(file)))
    assert found.level is Severity.WARN
    assert text in found.text


def test_keys_that_others_can_read_are_reported(tmp_path: Path) -> None:
    key, file = tmp_path / "rover.key", tmp_path / "zenoh.json5"
    key.touch(mode=0o600)
    file.write_text(f'{{transport: {{link: {{tls: {{listen_private_key: "{key}"}}}}}}}}')
    file.chmod(0o644)
    options = Zenoh(config_file=str(file))
    assert list(network.keys(options)) == []
    key.chmod(0o666)
    file.chmod(0o666)
    of_key, of_file = network.keys(options)
    assert of_key.text == f"{key}: mode 666, others can read it"
    assert of_key.remedy == f"sudo chmod 600 {key}"
    assert of_file.text == f"{file}: mode 666, others can write it"


@pytest.mark.parametrize("taken", [True, False])
def test_what_an_endpoint_carries_is_not_reported(machine: Machine, endpoint: str, taken: bool) -> None:
    secret = f"{endpoint}#listen_private_key_base64=SECRET"
    options = Zenoh(listen=[secret], connect=[f"{endpoint}#connect_private_key_base64=SECRET"])
    with socket.create_server(("127.0.0.1", int(endpoint.rpartition(":")[2]) if taken else 0)):
        found = list(network.check(machine(Config(zenoh=options))))
    assert sum(endpoint in one.text for one in found) == 2
    assert not any("SECRET" in f"{one.text} {one.remedy}" for one in found)


def test_the_ports_of_the_file_are_looked_at_too(machine: Machine, endpoint: str, tmp_path: Path) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text(f'{{listen: {{endpoints: ["{endpoint.replace("127.0.0.1", "0.0.0.0")}"]}}}}')
    found = bad(list(network.check(machine(Config(zenoh=Zenoh(listen=[], config_file=str(file)))))))
    assert "anyone who reaches this port" in found.text


# The daemon.


@pytest.fixture
def running(endpoint: str) -> Iterator[Config]:
    """All of a daemon that is on Zenoh, publishing diagnostics until the end; its configuration."""
    config = Config(zenoh=Zenoh(listen=[endpoint]))
    link = Link(open_session(config.zenoh), config)
    statuses = [
        DeviceStatus("camera", Level.OK, "delivers", {"rate_hz": "30.00"}),
        DeviceStatus("pipeline", Level.WARN, "dark", {"camera_readout_ms": "23.0", "latency_p50_ms": "3.2"}),
    ]
    ended = threading.Event()

    def tell() -> None:
        while not ended.wait(0.05):
            link.put_diagnostics(statuses, 1)

    thread = threading.Thread(target=tell)
    thread.start()
    yield config
    ended.set()
    thread.join()
    link.close()


def test_a_running_daemon_is_asked(machine: Machine, running: Config) -> None:
    found = daemon.ask(running)
    assert found is not None
    assert found.scene == "no scene yet"
    context = machine(running)
    context.__dict__["daemon"] = found
    answers, pipeline = health.check(context)
    assert answers.text.endswith("has no scenes (no scene yet)")
    assert (pipeline.level, pipeline.text) == (
        Severity.WARN,
        "pipeline: dark (latency_p50_ms 3.2, camera_readout_ms 23.0)",
    )
    held = next(network.check(context))
    assert (held.level, held.text) == (Severity.OK, f"{running.zenoh.listen[0]}: the daemon listens")


def test_nobody_is_asked_where_nobody_listens(endpoint: str) -> None:
    assert daemon.ask(Config(zenoh=Zenoh(listen=[endpoint]))) is None


def test_what_listens_but_is_no_daemon_is_not_waited_for_long(
    other: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(daemon, "ANSWER_S", 0.2)
    assert daemon.ask(Config(zenoh=Zenoh(listen=[f"tcp/127.0.0.1:{other[1]}"]))) is None


def test_a_daemon_that_does_not_answer_is_reported(machine: Machine, process: Callable[..., None]) -> None:
    process(5, "lcf-edge", "run")
    found = bad(list(health.check(machine())))
    assert found.text.startswith("lcf-edge run, process 5 does not answer")
    assert found.remedy == "tr '\\0' ' ' < /proc/5/cmdline"


def test_no_daemon_is_no_trouble(machine: Machine) -> None:
    (found,) = health.check(machine())
    assert (found.level, found.text) == (Severity.OK, "not running")
