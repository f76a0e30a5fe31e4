"""What PyPI shows: the README, with links that lead somewhere from there, and addresses that one table sets."""

import re
import subprocess
import sys
import tomllib
from email.message import Message
from email.parser import HeaderParser
from pathlib import Path

import pytest
from readme_renderer.markdown import render

ROOT = Path(__file__).parents[2]
PLACE = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["lcf-edge"]


@pytest.fixture(scope="module")
def metadata(tmp_path_factory: pytest.TempPathFactory) -> Message:
    """As it goes into a package."""
    place = tmp_path_factory.mktemp("metadata")
    command = (sys.executable, "setup.py", "--quiet", "egg_info", "--egg-base", str(place))
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (file,) = place.glob("*.egg-info/PKG-INFO")
    return HeaderParser().parsestr(file.read_text(encoding="utf-8"))


def test_the_readme_renders_and_no_link_is_relative(metadata: Message) -> None:
    assert metadata["Description-Content-Type"] == "text/markdown"
    page = render(str(metadata.get_payload()))
    assert page is not None
    links = re.findall(r'(?:href|src)="([^"]+)"', page)
    written = (ROOT / "README.md").read_text(encoding="utf-8")
    assert sum(not link.startswith("#user-content") for link in links) == written.count("](") > 0  # all but headings
    assert [link for link in links if not link.startswith(("https://", "#"))] == []
    shown = [link for link in links if link.startswith(PLACE["pictures"])]
    led_to = [link for link in links if link.startswith(PLACE["files"])]
    assert shown
    for link in (*shown, *led_to):
        name = link.removeprefix(PLACE["pictures"]).removeprefix(PLACE["files"]).partition("#")[0]
        assert (ROOT / name).exists(), link


def test_the_addresses_are_those_of_one_table(metadata: Message) -> None:
    urls = dict(str(line).split(", ") for line in metadata.get_all("Project-URL") or ())
    assert urls["Homepage"] == PLACE["home"]
    assert all(url.startswith((PLACE["home"], PLACE["files"])) for url in urls.values())
    others = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "lcf_edge").rglob("*.py")]
    assert [path for path in others if PLACE["home"] in path.read_text(encoding="utf-8")] == []


def test_pypi_is_told_what_people_search_for(metadata: Message) -> None:
    assert metadata["Requires-Python"] == ">=3.11"
    assert metadata["License-Expression"] == "Apache-2.0"
    assert {"robotics", "zenoh", "ros2"} <= set(str(metadata["Keywords"]).split(","))
    assert any(
        "Robot" in str(each) or "Image Recognition" in str(each) for each in metadata.get_all("Classifier") or ()
    )
