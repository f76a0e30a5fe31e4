"""The certificates of the gate, all in one folder."""

import ssl
from pathlib import Path
from typing import Any

from lcf_edge.errors import LcfError

ROVER_NAME = "localhost"  # in the rover's certificate, by which the gate knows the daemon


class Certificates:
    """``server``: for parties, who need a certificate of ``ca.pem``. Raises ``LcfError`` that names the file.

    ``parties``: by the common name of a party, the certificate by which the gate tells the daemon for whom it connects:
    ``inner/NAME.pem``, or ``inner_NAME.pem`` as systemd hands it over, of an authority that the daemon alone trusts.
    """

    def __init__(self, folder: Path) -> None:
        rover, key, authority = folder / "rover.pem", folder / "rover.key", folder / "ca.pem"
        self.server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.server.minimum_version = ssl.TLSVersion.TLSv1_3
        self.server.verify_mode = ssl.CERT_REQUIRED
        self.server.num_tickets = 0
        _load(self.server, rover, key, authority)
        files = [*folder.glob("inner/*.pem"), *folder.glob("inner_*.pem")]
        self.parties = {path.stem.removeprefix("inner_"): _client(path, authority) for path in sorted(files)}
        if not self.parties:
            raise LcfError(f"{folder / 'inner'}: no certificates; docs/network.md says how to make them")


def common_name(connection: ssl.SSLObject) -> str:
    """Return the common name of the peer's certificate; empty: it has none."""
    certificate: dict[str, Any] = connection.getpeercert() or {}
    return next((value for part in certificate.get("subject", ()) for name, value in part if name == "commonName"), "")


def _client(certificate: Path, authority: Path) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    _load(context, certificate, certificate.with_suffix(".key"), authority)
    return context


def _load(context: ssl.SSLContext, certificate: Path, key: Path, authority: Path) -> None:
    try:
        context.load_cert_chain(certificate, key)
        context.load_verify_locations(authority)
    except (ssl.SSLError, OSError) as error:
        missing = next((path for path in (certificate, key, authority) if not path.exists()), certificate)
        why = error.strerror or "no certificate"
        raise LcfError(f"{missing}: cannot be used ({why}); docs/network.md says how to make it") from error
