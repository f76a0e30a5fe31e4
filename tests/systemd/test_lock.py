"""What `make install` fetches: exact versions with hashes, of all that the program needs, and of nothing known bad."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "requirements.lock").read_text(encoding="utf-8")
KNOWN_BAD = {"aiohttp": (3, 14, 1), "opencv-python-headless": (4, 12)}  # what is older than these


def version(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", text))


def needed() -> dict[str, tuple[int, ...]]:
    """Least versions by name."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *extras["view"], *extras["watch"]]
    return {name: version(least) for name, least in (re.split(r">=", one, maxsplit=1) for one in wanted)}


LOCKED = {name: version(number) for name, number in re.findall(r"^([\w.-]+)==([\w.]+)", TEXT, re.M)}


def test_all_that_is_needed_is_locked_at_what_is_needed_or_later() -> None:
    assert {name for name, least in needed().items() if LOCKED[name] < least} == set()


def test_nothing_with_known_holes_is_allowed_or_locked() -> None:
    for name, fixed in KNOWN_BAD.items():
        assert needed()[name] >= fixed
        assert LOCKED[name] >= fixed


def test_each_has_its_hashes_and_comes_from_wherever_packages_come() -> None:
    entries = re.split(r"^(?=\w)", TEXT, flags=re.M)[1:]
    assert len(entries) >= len(LOCKED) >= len(needed())
    assert all(re.search(r"--hash=sha256:[0-9a-f]{64}", entry) for entry in entries)
    assert "//" not in TEXT


def test_the_lock_is_what_is_installed() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "--require-hashes -r requirements.lock" in makefile
    assert '--no-deps "$(or $(wildcard $(WHEEL)),$(WHEEL),.)"' in makefile
