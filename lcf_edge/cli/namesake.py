"""Other packages of the same name as ours: Python imports the first that it finds."""

from importlib.util import find_spec
from pathlib import Path

_HERE = Path(__file__).parents[2]


def namesake(package: str) -> str:
    """Return the folder of a foreign ``package`` that would be imported instead of ours; empty: none."""
    spec = find_spec(package)
    folder = Path(spec.origin).parent if spec and spec.origin else _HERE / package
    return "" if folder.resolve() == (_HERE / package).resolve() else str(folder)
