"""What Zenoh would wait for without end is refused before."""

import pytest

from lcf_edge.cli.command_line import main
from lcf_edge.client import scenes
from lcf_edge.config import load
from lcf_edge.config.endpoint import fault
from lcf_edge.errors import ConfigError, PublishError


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/127.0.0.1:7447",
        "tcp/127.0.0.1:0",
        "tls/rover.local:65535",
        "udp/[fe80::1%eth0]:7447?rel=0",
        "tcp/::1:7447",
        "tcp/127.0.0.1:7447#iface=lo",
        "unixsock-stream//run/lcf-edge/socket",
        "serial//dev/ttyUSB0",
    ],
)
def test_what_can_be_an_endpoint_is_taken(endpoint: str) -> None:
    assert fault(endpoint) == ""


@pytest.mark.parametrize(
    ("endpoint", "why"),
    [
        ("tcp/127.0.0.1", "no port"),
        ("tcp/rover.local", "no port"),
        ("tcp/[::1]", "no port"),
        ("tcp/:7447", "no host"),
        ("tcp/rover:", "invalid port"),
        ("tcp/rover:http", "invalid port"),
        ("tcp/rover:65536", "invalid port"),
        ("tcp/rover:-1", "invalid port"),
        ("tls/rover", "no port"),
        ("rover:7447", "not an endpoint (protocol/address)"),
        ("tcp/", "not an endpoint (protocol/address)"),
        ("/rover:7447", "not an endpoint (protocol/address)"),
        ("", "not an endpoint (protocol/address)"),
    ],
)
def test_what_can_be_none_is_reported_with_a_remedy(endpoint: str, why: str) -> None:
    message = fault(endpoint)
    assert message.startswith(f"{endpoint}: {why}; write ")


def test_keys_in_an_endpoint_are_not_reported() -> None:
    assert fault("tls/rover#root_ca_certificate_base64=c2VjcmV0") == fault("tls/rover")


@pytest.mark.parametrize("key", ["connect", "listen"])
def test_a_configuration_with_one_is_refused(key: str) -> None:
    with pytest.raises(ConfigError, match=rf"^--set: zenoh\.{key}: tcp/127\.0\.0\.1: no port; write for example "):
        load(None, [f'zenoh.{key}=["tcp/127.0.0.1"]'])


@pytest.mark.parametrize("command", ["watch", "view", "foxglove"])
def test_a_command_refuses_it_at_once_by_the_name_of_its_option(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, "--connect", "tcp/127.0.0.1"]) == 1
    assert capsys.readouterr().err.startswith("lcf-edge: --connect: tcp/127.0.0.1: no port; write ")


def test_a_planner_is_reported_at_once() -> None:
    with pytest.raises(PublishError, match="no port"):
        scenes("tcp/127.0.0.1")
