"""Run the filter over frames that a test has written, and print a digest of all tables after each."""

import hashlib
import pickle
import sys
from pathlib import Path

from lcf_edge.filter import LineCircleFilter, alpha
from lcf_edge.filter.line_circle_filter import Step


def digest(tables: LineCircleFilter, step: Step) -> str:
    """Of all that a step leaves behind."""
    found = hashlib.sha256(step.omitted.tobytes() + repr(step.sizes).encode())
    for table in (tables.edges, tables.normal, tables.rebel, tables.objects, tables.psi, tables.groups):
        for column in table.arrays.values():
            found.update(column.tobytes())
    for column in (tables.patches.x, tables.patches.y, tables.patches.scale, tables.patches.sigma):
        found.update(bytes(column))
    shutter, floor = tables.shutter, tables.floor
    found.update(repr((shutter.readout_s, shutter.sigma_s, shutter.matters, floor.under_s, floor.seen_s)).encode())
    return found.hexdigest()


def main(path: Path) -> None:
    """``path``: a pickle of the configuration, the lens, and what each step takes."""
    config, lens, frames = pickle.loads(path.read_bytes())
    tables = LineCircleFilter(config, lens)
    lines = ["uncompiled" if str(alpha.__file__).endswith(".py") else "compiled"]
    lines += [digest(tables, tables.step(*taken)) for taken in frames]
    sys.stdout.write("\n".join(lines))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
