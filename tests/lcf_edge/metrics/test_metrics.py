"""The diagnostics as Prometheus reads them, by its own parser."""

import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from http.client import HTTPConnection
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from prometheus_client.parser import text_string_to_metric_families

from lcf_edge.config import Config, Metrics, Publish
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.errors import LcfError
from lcf_edge.metrics import endpoint as endpoint_module
from lcf_edge.metrics.endpoint import Endpoint
from lcf_edge.metrics.sink import MetricsSink
from lcf_edge.metrics.text import prometheus_text

STATUSES = (
    DeviceStatus("camera", Level.OK, "delivers", {"rate_hz": "20.00", "age_s": "inf", "device": "/dev/video0"}),
    DeviceStatus("pipeline", Level.WARN, "slow", {"psi_fill": "2/32", "gyro_bias_radps": "0.1 0.2 0.3", "bad": "nan"}),
    DeviceStatus("link", Level.STALE, "", {"scene sent": "17"}),
)


def read(text: bytes) -> dict[str, float]:
    """Value by name, and level by part."""
    found = {}
    for family in text_string_to_metric_families(text.decode()):
        for sample in family.samples:
            assert sample.labels["robot"] == 'ro"v\\er'
            found[sample.labels.get("part", sample.name)] = sample.value
    return found


def test_levels_and_numbers_are_reported_and_nothing_else() -> None:
    metrics = read(prometheus_text(STATUSES, 'ro"v\\er'))
    assert str(metrics.pop("lcf_edge_pipeline_bad")) == "nan"
    assert metrics == {
        "camera": 0,
        "pipeline": 1,
        "link": 3,
        "lcf_edge_camera_rate_hz": 20.0,
        "lcf_edge_camera_age_s": float("inf"),
        "lcf_edge_pipeline_psi_fill_used": 2,
        "lcf_edge_pipeline_psi_fill_capacity": 32,
        "lcf_edge_link_scene_sent": 17,
    }


@given(st.text(), st.text(), st.text(), st.text())
def test_whatever_is_said_prometheus_can_read_it(robot: str, name: str, key: str, value: str) -> None:
    text = prometheus_text([DeviceStatus(name, Level.OK, "", {key: value, f"{key} ": value})], robot)
    assert list(text_string_to_metric_families(text.decode()))


def test_the_file_is_replaced_as_a_whole_and_goes_in_the_end(tmp_path: Path) -> None:
    path = tmp_path / "lcf-edge.prom"
    sink = MetricsSink(Config(metrics=Metrics(textfile=str(path)), publish=Publish(robot='ro"v\\er')))
    for _ in range(2):
        sink.put_diagnostics(5, STATUSES)
        assert read(path.read_bytes())["link"] == 3
        assert list(tmp_path.iterdir()) == [path]
        assert path.stat().st_mode & 0o777 == 0o644
    assert sink.status().level is Level.OK
    sink.close()
    assert not path.exists()


def test_a_file_that_cannot_be_written_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "lcf-edge.prom"
    sink = MetricsSink(Config(metrics=Metrics(textfile=str(path))))
    sink.put_diagnostics(5, STATUSES)
    status = sink.status()
    assert status.level is Level.WARN
    assert str(path) in status.message
    sink.close()


@pytest.fixture
def endpoint() -> Iterator[Endpoint]:
    endpoint = Endpoint(0)
    endpoint.text = b"lcf_edge_level 0\n"
    endpoint.start()
    yield endpoint
    endpoint.close()


@pytest.mark.parametrize(
    ("path", "host", "status"),
    [
        ("/metrics", "127.0.0.1:9", 200),
        ("/metrics", "localhost", 200),
        ("/metrics", "evil.example", 403),
        ("/metrics", "", 403),
        ("/", "localhost", 404),
    ],
)
def test_the_port_serves_metrics_to_this_machine_alone(endpoint: Endpoint, path: str, host: str, status: int) -> None:
    connection = HTTPConnection("127.0.0.1", endpoint.port, timeout=10)
    connection.request("GET", path, headers={"Host": host})
    answer = connection.getresponse()
    assert answer.status == status
    assert (answer.read() == endpoint.text) == (status == 200)
    connection.close()


@pytest.fixture
def slow(endpoint: Endpoint) -> Iterator[None]:
    """Somebody who sends one letter after another, and never all of them."""
    gone = threading.Event()
    with socket.create_connection(("127.0.0.1", endpoint.port)) as one:

        def drip() -> None:
            with suppress(OSError):
                one.sendall(b"GET /metrics HTTP/1.1\r\nX: ")
                while not gone.wait(0.1):
                    one.sendall(b"x")

        dripping = threading.Thread(target=drip)
        dripping.start()
        yield
        gone.set()
        dripping.join()


@pytest.mark.usefixtures("slow")
def test_who_sends_slowly_is_cut_off_and_others_are_served(endpoint: Endpoint) -> None:
    connection = HTTPConnection("127.0.0.1", endpoint.port, timeout=20)
    connection.request("GET", "/metrics", headers={"Host": "localhost"})
    assert connection.getresponse().read() == endpoint.text
    connection.close()


@pytest.mark.usefixtures("slow")
def test_who_sends_slowly_does_not_hold_up_the_end(endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(endpoint_module, "_WITHIN_S", 20.0)
    endpoint.close()
    assert not endpoint._thread.is_alive()


def test_who_comes_while_it_ends_does_not_hold_it_up_either(
    endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(endpoint_module, "_WITHIN_S", 60.0)
    endpoint._server.cut()  # there is nobody yet
    with socket.create_connection(("127.0.0.1", endpoint.port), timeout=20) as late:
        assert late.recv(1) == b""


def test_a_port_that_is_taken_is_reported_by_its_key(endpoint: Endpoint) -> None:
    with pytest.raises(LcfError, match=r"metrics\.port"):
        Endpoint(endpoint.port)
