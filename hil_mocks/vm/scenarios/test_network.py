"""A subscriber on another computer: TCP with TLS, both sides certified."""

import subprocess
from pathlib import Path

import pytest

from hil_mocks.vm.daemon import WEBCAM, Daemon, Subscriber
from hil_mocks.vm.machine import Machine, MachineError

SECURE = '\n[zenoh]\nlisten = ["tls/0.0.0.0:7447"]\nconfig_file = "/etc/lcf-edge/zenoh.json5"\n'
KEY = "/run/credentials/lcf-edge.service/rover.key"
DROP_IN = f"[Service]\nLoadCredential=rover.key:/etc/lcf-edge/tls/{Path(KEY).name}\n"
STRANGERS_WAIT_S = 8.0


def certify(folder: Path, name: str, authority: str) -> None:
    """A key and a certificate, as docs/network.md says."""
    new = ("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-noenc")
    signed: tuple[str, ...] = ()
    if name != authority:
        names = "subjectAltName=DNS:localhost,IP:127.0.0.1"
        signed = ("-CA", f"{authority}.pem", "-CAkey", f"{authority}.key")
        signed += ("-addext", "basicConstraints=critical,CA:FALSE", "-addext", names)
    command = (*new, *signed, "-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.pem")
    subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=60)


def zenoh_file(path: Path, **tls: object) -> str:
    """Zenoh's own configuration."""
    settings = ", ".join(f"{key}: {str(value).lower() if value is True else repr(value)}" for key, value in tls.items())
    path.write_text(f"{{transport: {{link: {{tls: {{{settings}}}}}}}}}\n", encoding="ascii")
    return str(path)


@pytest.fixture(scope="module")
def secured(machine: Machine, daemon: Daemon) -> Path:
    """The daemon listens for certified peers only. Return the folder with their certificates."""
    folder = machine.share / "tls"
    folder.mkdir()
    for name, authority in (("ca", "ca"), ("rover", "ca"), ("planner", "ca"), ("other", "other"), ("thief", "other")):
        certify(folder, name, authority)
    zenoh_file(
        folder / "zenoh.json5",
        root_ca_certificate="/etc/lcf-edge/tls/ca.pem",
        listen_certificate="/etc/lcf-edge/tls/rover.pem",
        listen_private_key=KEY,
        enable_mtls=True,
    )
    machine.run(
        "install -D -m 644 -t /etc/lcf-edge/tls /mnt/tls/ca.pem /mnt/tls/rover.pem;"
        "install -m 600 -o root -t /etc/lcf-edge/tls /mnt/tls/rover.key;"
        "install -m 644 -t /etc/lcf-edge /mnt/tls/zenoh.json5;"
        "mkdir -p /run/systemd/system/lcf-edge.service.d"
    )
    (folder / "tls.conf").write_text(DROP_IN, encoding="ascii")
    machine.run("cp /mnt/tls/tls.conf /run/systemd/system/lcf-edge.service.d/; systemctl daemon-reload")
    daemon.start(WEBCAM + SECURE)
    return folder


def connected(machine: Machine, folder: Path, name: str, authority: str) -> Subscriber:
    """A subscriber with that certificate."""
    file = zenoh_file(
        folder / f"{name}.json5",
        root_ca_certificate=str(folder / f"{authority}.pem"),
        connect_certificate=str(folder / f"{name}.pem"),
        connect_private_key=str(folder / f"{name}.key"),
        enable_mtls=True,
        verify_name_on_connect=True,
    )
    return Subscriber(machine.endpoint.replace("tcp/", "tls/"), machine.patience, file)


def test_a_planner_with_a_certificate_receives_scenes(machine: Machine, secured: Path) -> None:
    planner = connected(machine, secured, "planner", "ca")
    try:
        planner.wait_for_scenes()
        planner.wait_for_status("camera", "delivers")
    finally:
        planner.close()


def test_a_certificate_of_another_authority_receives_nothing(machine: Machine, secured: Path) -> None:
    thief = connected(machine, secured, "thief", "ca")
    try:
        with pytest.raises(MachineError, match="not within"):
            thief.wait_for(lambda: thief.scenes, "a scene", STRANGERS_WAIT_S)
    finally:
        thief.close()
