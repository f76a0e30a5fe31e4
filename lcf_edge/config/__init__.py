"""Configuration: ``config`` has the typed tables and reads them.

``bounded_toml`` parses, ``endpoint`` knows what can be an endpoint, ``refusal`` says why a value cannot be used,
``shown`` hides secrets.
"""

from lcf_edge.config.config import (
    DEFAULT_PATH,
    MAX_POINTS,
    MAX_POLYGONS,
    PAPER,
    ROVER,
    Camera,
    Config,
    Filter,
    Imu,
    ImuDriver,
    Log,
    Memory,
    Metrics,
    Publish,
    Record,
    Table,
    Vehicle,
    Zenoh,
    is_filled,
    load,
    to_toml,
)

__all__ = [
    "DEFAULT_PATH",
    "MAX_POINTS",
    "MAX_POLYGONS",
    "PAPER",
    "ROVER",
    "Camera",
    "Config",
    "Filter",
    "Imu",
    "ImuDriver",
    "Log",
    "Memory",
    "Metrics",
    "Publish",
    "Record",
    "Table",
    "Vehicle",
    "Zenoh",
    "is_filled",
    "load",
    "to_toml",
]
