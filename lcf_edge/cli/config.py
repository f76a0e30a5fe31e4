"""``lcf-edge config``: the effective configuration and the memory that it needs."""

from lcf_edge.config import Config, to_toml
from lcf_edge.lens import Lens
from lcf_edge.pipeline import Pipeline


def report(config: Config) -> str:
    """Return the configuration as TOML, then comment lines with the bytes of each table and their sum.

    The whole is valid TOML. Raises ``ConfigError`` when the camera's intrinsics cannot be used.
    """
    camera = config.camera
    tables = Pipeline(config, Lens.from_config(camera, camera.width, camera.height)).table_bytes()
    rows = {**tables, "in all": sum(tables.values())}
    wide = max(map(len, rows))
    lines = [f"#   {name:<{wide}}  {size:>10,}" for name, size in rows.items()]
    return "\n".join((to_toml(config), "# bytes of each table, allocated at the start", *lines))
