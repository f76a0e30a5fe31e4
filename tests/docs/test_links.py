"""Links and images of the documents lead somewhere."""

import re
from pathlib import Path

import cv2
import pytest

from lcf_edge import __version__

ROOT = Path(__file__).parents[2]
DOCUMENTS = (ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md")))
MAX_IMAGE_BYTES = 250_000


def anchors(document: Path) -> set[str]:
    """Of its headings, as a forge makes them."""
    headings = re.findall(r"^#+ (.+)$", document.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_resolve(document: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", document.read_text(encoding="utf-8")):
        if target.startswith("https://"):
            continue
        name, _, anchor = target.partition("#")
        there = document.parent / name if name else document
        assert there.exists(), target
        assert not anchor or anchor in anchors(there), target


@pytest.mark.parametrize("image_path", sorted((ROOT / "docs").rglob("*.png")), ids=lambda path: path.name)
def test_images_are_small_and_shown(image_path: Path) -> None:
    assert image_path.stat().st_size <= MAX_IMAGE_BYTES
    assert cv2.imread(str(image_path)) is not None
    assert any(f"pictures/{image_path.name})" in document.read_text(encoding="utf-8") for document in DOCUMENTS)


def test_the_animation_of_the_readme_has_ten_seconds_in_two_megabytes() -> None:
    image_path = ROOT / "docs/pictures/overlay.webp"
    assert image_path.stat().st_size < 2_000_000
    read, animation = cv2.imreadanimation(str(image_path))
    assert read
    assert sum(animation.durations) == 10_000  # ms
    assert "(docs/pictures/overlay.webp)" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_changelog_knows_this_version() -> None:
    assert __version__ in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
