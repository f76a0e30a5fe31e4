"""The configuration that ``lcf-edge record`` puts into its files."""

import struct
from pathlib import Path

from mcap.exceptions import McapError
from mcap.records import Attachment, Chunk
from mcap.stream_reader import StreamReader

from lcf_edge.errors import ConfigError

IN_RECORDING = "lcf-edge.toml"
"""Name of the attachment."""

_MAX_BYTES = 2**20  # of a record; a chunk may be larger, but the attachment lies before the first


def attached_configuration(path: Path) -> bytes:
    """The configuration with which a recording began. Raises ``OSError``, and ``ConfigError`` when it has none."""
    with path.open("rb") as file:
        try:
            for record in StreamReader(file, emit_chunks=True, record_size_limit=_MAX_BYTES).records:
                if isinstance(record, Attachment) and record.name == IN_RECORDING:
                    return record.data
                if isinstance(record, Chunk):  # the attachment lies before the first chunk
                    break
        except (McapError, struct.error, UnicodeDecodeError, OverflowError, MemoryError):  # damaged, also its lengths
            pass
    raise ConfigError(f"{path}: no configuration in it; only lcf-edge record puts one in; name a TOML file with -c")
