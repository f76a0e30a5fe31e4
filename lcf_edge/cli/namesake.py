"""Another package with the name of ours: Python takes whichever it finds first."""

from importlib.util import find_spec
from pathlib import Path

_HERE = Path(__file__).parents[2]


def namesake(package: str) -> str:
    """The folder of a foreign ``package`` that would be imported in place of ours; empty: ours would be."""
    spec = find_spec(package)
    folder = Path(spec.origin).parent if spec and spec.origin else _HERE / package
    return "" if folder.resolve() == (_HERE / package).resolve() else str(folder)
