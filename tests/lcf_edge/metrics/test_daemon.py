"""A running daemon exports its metrics to a file and on a port."""

import subprocess
import sys
import time
from http.client import HTTPConnection
from pathlib import Path

from prometheus_client.parser import text_string_to_metric_families

PATIENCE_S = 20.0


def test_a_daemon_without_a_camera_reports_so(tmp_path: Path, endpoint: str) -> None:
    textfile, port = tmp_path / "lcf-edge.prom", 1 + int(endpoint.rpartition(":")[2]) % 60000
    settings = (
        f'zenoh.listen=["{endpoint}"]',
        "camera.device=/dev/no-such-camera",
        f"metrics.textfile={textfile}",
        f"metrics.port={port}",
    )
    command = [sys.executable, "-m", "lcf_edge", "run", *(part for one in settings for part in ("--set", one))]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as daemon:
        deadline_s = time.monotonic() + PATIENCE_S
        while not textfile.exists():
            assert time.monotonic() < deadline_s
            assert daemon.poll() is None
            time.sleep(0.05)
        connection = HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
        connection.request("GET", "/metrics")
        served = connection.getresponse().read()
        connection.close()
        written = textfile.read_bytes()
        daemon.terminate()
        daemon.communicate(timeout=PATIENCE_S)
        assert daemon.returncode == 0
    for text in (served, written):
        levels = {
            sample.labels["part"]: sample.value
            for family in text_string_to_metric_families(text.decode())
            for sample in family.samples
            if sample.name == "lcf_edge_level"
        }
        assert levels["camera"] == 2
        assert levels["metrics"] == 0
    assert not textfile.exists()
