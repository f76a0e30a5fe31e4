"""The configuration as it is shown to others: without what follows ``#`` in Zenoh endpoints, which may be secrets."""

import msgspec

from lcf_edge.config import Config, to_toml


def shown(config: Config) -> str:
    """Return it as TOML."""
    zenoh = config.zenoh
    bare = msgspec.structs.replace(
        zenoh,
        connect=[_bare(endpoint) for endpoint in zenoh.connect],
        listen=[_bare(endpoint) for endpoint in zenoh.listen],
    )
    return to_toml(msgspec.structs.replace(config, zenoh=bare))


def _bare(endpoint: str) -> str:
    return endpoint.partition("#")[0]
