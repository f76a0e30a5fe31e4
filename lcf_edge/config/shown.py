"""The configuration as it is shown to others: without the secrets that Zenoh's endpoints may carry."""

import msgspec

from lcf_edge.config import Config, to_toml
from lcf_edge.config.endpoint import bare


def shown(config: Config) -> str:
    """Return it as TOML."""
    zenoh = config.zenoh
    without = msgspec.structs.replace(
        zenoh,
        connect=[bare(endpoint) for endpoint in zenoh.connect],
        listen=[bare(endpoint) for endpoint in zenoh.listen],
    )
    return to_toml(msgspec.structs.replace(config, zenoh=without))
