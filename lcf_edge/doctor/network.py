"""Zenoh: its configuration, its ports, and who can reach them."""

import json
import shlex
import stat
from collections.abc import Iterator
from pathlib import Path

import msgspec
import zenoh

from lcf_edge.config import Zenoh
from lcf_edge.config.endpoint import bare
from lcf_edge.doctor.endpoints import is_open, parsed, reachable_here
from lcf_edge.doctor.finding import Context, Finding, edit, fail, ok, warn
from lcf_edge.doctor.processes import listening
from lcf_edge.errors import PublishError
from lcf_edge.zenoh_link.session import opened_session

_LOOPBACK = 'zenoh.listen=["tcp/127.0.0.1:7447"]'
_KEYS = ("listen_private_key", "connect_private_key")
_NEXT_PORT = 'zenoh.listen=["tcp/127.0.0.1:7457"]'


def check(context: Context) -> Iterator[Finding]:
    """Configuration, ports, exposure, neighbours."""
    options = _with_the_files(context.config.zenoh)
    taken = [endpoint for endpoint in options.listen if _is_taken(endpoint)]
    if taken:
        for endpoint in taken:
            yield _held(context, endpoint)
    else:
        yield _opens(context.config.zenoh)
    yield from exposed(context, options)
    yield from keys(options)
    for endpoint in options.connect:
        yield _connects(endpoint)


def exposed(context: Context, options: Zenoh) -> Iterator[Finding]:
    """Check whether strangers can read scenes and send a speed."""
    outside = [endpoint for endpoint in options.listen if (parts := parsed(endpoint)) and not parts.local]
    plain = [endpoint for endpoint in outside if (parts := parsed(endpoint)) and not parts.encrypted]
    if plain:
        yield warn(
            "network",
            f"{', '.join(plain)}: anyone who reaches this port can read every scene and send a speed "
            "(no encryption, no passwords); docs/network.md says how to open it with TLS",
            context.again(_LOOPBACK),
        )
    elif outside and not _wants_certificates(options):
        yield warn(
            "network",
            f"{', '.join(outside)}: encrypted, but anyone is let in; docs/network.md has the lines for enable_mtls",
            edit(Path(options.config_file or "/etc/lcf-edge/zenoh.json5")),
        )
    elif outside:
        yield warn(
            "network",
            f"{', '.join(outside)}: only for holders of a certificate, but strangers can block them; "
            "let lcf-edge gate listen there (docs/network.md)",
            "sudo systemctl enable --now lcf-edge-gate",
        )
    else:
        yield ok("network", "only this computer can reach it")


def keys(options: Zenoh) -> Iterator[Finding]:
    """Check whether others can read the private keys named in the file, or write the file."""
    settings = _settings(options)
    named = [json.loads(settings.get_json(f"transport/link/tls/{key}")) for key in _KEYS]
    for path, forbidden in [(Path(name), 0o077) for name in named if name] + [(Path(options.config_file), 0o022)]:
        try:
            mode = path.stat().st_mode
        except OSError:  # a missing file is reported where it is opened
            continue
        if stat.S_ISREG(mode) and mode & forbidden:
            what = "read" if forbidden == 0o077 else "write"
            text = f"{path}: mode {stat.S_IMODE(mode):o}, others can {what} it"
            yield warn("network", text, f"sudo chmod {'600' if what == 'read' else 'go-w'} {shlex.quote(str(path))}")


def _wants_certificates(options: Zenoh) -> bool:
    return bool(json.loads(_settings(options).get_json("transport/link/tls/enable_mtls")))


def _with_the_files(options: Zenoh) -> Zenoh:
    """Fill in endpoints that the configuration leaves to ``zenoh.config_file``; all without secrets."""
    settings = _settings(options)
    listen = options.listen or _endpoints(settings, "listen")
    connect = options.connect or _endpoints(settings, "connect")
    return msgspec.structs.replace(options, listen=[*map(bare, listen)], connect=[*map(bare, connect)])


def _endpoints(settings: zenoh.Config, name: str) -> list[str]:
    """Return endpoints given as a list, or as a list for each mode."""
    endpoints = json.loads(settings.get_json(f"{name}/endpoints"))
    return (
        [endpoint for one in endpoints.values() for endpoint in one] if isinstance(endpoints, dict) else list(endpoints)
    )


def _settings(options: Zenoh) -> zenoh.Config:
    """Return the file's settings; defaults where it cannot be read: opening the session reports that."""
    try:
        return zenoh.Config.from_file(options.config_file) if options.config_file else zenoh.Config()
    except zenoh.ZError:
        return zenoh.Config()


def _is_taken(endpoint: str) -> bool:
    parts = parsed(endpoint)
    return parts is not None and not parts.datagrams and is_open(reachable_here(endpoint))


def _held(context: Context, endpoint: str) -> Finding:
    parts = parsed(endpoint)
    holder = listening(parts, context.proc) if parts else None
    if context.daemon is not None or (holder is not None and holder.is_daemon):
        return ok("network", f"{endpoint}: the daemon listens" + (f" ({holder})" if holder else ""))
    if holder is not None:
        return fail(
            "network", f"{endpoint}: taken by {holder}", f"kill {holder.pid}  # or: {context.again(_NEXT_PORT)}"
        )
    port = parts.port if parts else 0
    return fail("network", f"{endpoint}: taken by another user's program", f"sudo ss -ltnp 'sport = :{port}'")


def _opens(options: Zenoh) -> Finding:
    try:
        with opened_session(options):
            places = ", ".join(map(bare, options.listen)) or "nothing"
            return ok("network", f"Zenoh opens as {options.mode}, listens on {places}")
    except PublishError as error:
        file = options.config_file
        return fail("network", str(error), edit(Path(file)) if file and file in str(error) else "")


def _connects(endpoint: str) -> Finding:
    if is_open(endpoint):
        return ok("network", f"{endpoint}: somebody listens there")
    parts = parsed(endpoint)
    asked = "is it on, is zenohd or another lcf-edge running there?"
    remedy = f"ping -c 3 {shlex.quote(parts.host)}  # {asked}" if parts else ""
    return warn("network", f"{endpoint}: cannot be reached", remedy)
