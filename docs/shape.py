"""Draw docs/pictures/shape.svg, and write the table of columns in docs/developing.md: ``python docs/shape.py``.

The drawing shows which parts of the project import which. An arrow is left out where a longer way leads there as well.
Arrows go down; one that goes up is red.
"""

import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path

from lcf_edge.filter import tables

ROOT = Path(__file__).parents[1]
DRAWING = ROOT / "docs/pictures/shape.svg"
PAGE = ROOT / "docs/developing.md"
MANY = 4  # columns that the same modules write, and that need not be named
BEGIN, END = "<!-- columns: begin -->\n", "<!-- columns: end -->\n"

LAYERS = (
    ("cli",),
    ("monitor", "doctor", "calibrate", "evaluate"),
    ("web", "gate"),
    ("daemon", "client"),
    ("metrics",),
    ("devices", "pipeline", "sinks"),
    ("recording", "corners", "ego_motion"),
    ("filter", "zenoh_link"),
    ("standard_messages",),
    ("lens", "cdr"),
    ("config", "messages", "rendered"),
    ("drivers",),
)
"""From what a user meets down to what rests on nothing. Modules that only lend a word or a number are left out."""

TABLES = {
    "edges (E_n, E_r, α)": tables.EDGE_COLUMNS,
    "circles (C_n, C_r)": tables.CIRCLE_COLUMNS,
    "objects": tables.OBJECT_COLUMNS,
    "ψ": tables.PSI_COLUMNS,
    "groups (λ)": tables.GROUP_COLUMNS,
    "corners of the frame": tables.CORNER_COLUMNS,
}

_WIDTH, _ROW, _BOX_WIDTH, _BOX_HEIGHT = 760, 84, 150, 34

Arrows = Mapping[str, set[str]]


def imports() -> Arrows:
    """Return which part imports which, but for the sake of types alone."""
    parts = {part for layer in LAYERS for part in layer}
    arrows: dict[str, set[str]] = defaultdict(set)
    for path in (*(ROOT / "lcf_edge").rglob("*.py"), *(ROOT / "drivers").rglob("*.py")):
        source = _part(".".join(path.relative_to(ROOT).with_suffix("").parts))
        for module in _imported(ast.parse(path.read_text(encoding="utf-8"))):
            target = _part(module)
            if source in parts and target in parts and source != target:
                arrows[source].add(target)
    return arrows


def _part(module: str) -> str:
    package, _, rest = module.partition(".")
    return rest.partition(".")[0] if package == "lcf_edge" else package


def _imported(node: ast.AST) -> Iterator[str]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and isinstance(child.test, ast.Name) and child.test.id == "TYPE_CHECKING":
            continue
        if isinstance(child, ast.Import):
            yield from (alias.name for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            yield from (f"{child.module}.{alias.name}" for alias in child.names)
        else:
            yield from _imported(child)


def reduced(arrows: Arrows) -> list[tuple[str, str]]:
    """Return the arrows that no longer way down makes superfluous; those that go up all stay."""
    layer = {part: number for number, parts in enumerate(LAYERS) for part in parts}
    down = {part: {to for to in arrows.get(part, ()) if layer[to] > layer[part]} for part in layer}

    def reached(part: str) -> set[str]:
        return down[part].union(*(reached(to) for to in down[part]))

    kept = []
    for part in layer:
        implied = set[str]().union(*(reached(to) for to in down[part]))
        kept += [(part, to) for to in sorted(arrows.get(part, ())) if to not in implied]
    return kept


def svg() -> str:
    """Return the image."""
    place = {
        part: (round(_WIDTH * (column + 1) / (len(parts) + 1)), 30 + _ROW * row)
        for row, parts in enumerate(LAYERS)
        for column, part in enumerate(parts)
    }
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_ROW * len(LAYERS)}" '
        'font-family="sans-serif" font-size="14" text-anchor="middle">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for source, target in reduced(imports()):
        (x, y), (to_x, to_y) = place[source], place[target]
        if to_y > y:
            start, end, colour = y + _BOX_HEIGHT // 2, to_y - _BOX_HEIGHT // 2, "#778"
        else:
            start, end, colour = y - _BOX_HEIGHT // 2, to_y + _BOX_HEIGHT // 2, "#c22"
        bend = (start + end) // 2
        lines.append(f'<path d="M{x} {start}C{x} {bend} {to_x} {bend} {to_x} {end}" fill="none" stroke="{colour}"/>')
        lines.append(f'<circle cx="{to_x}" cy="{end}" r="3" fill="{colour}"/>')
    for part, (x, y) in place.items():
        left, top = x - _BOX_WIDTH // 2, y - _BOX_HEIGHT // 2
        size = f'width="{_BOX_WIDTH}" height="{_BOX_HEIGHT}" rx="5"'
        lines.append(f'<rect x="{left}" y="{top}" {size} fill="#eef3fa" stroke="#357"/>')
        lines.append(f'<text x="{x}" y="{y + 5}">{part}</text>')
    return "\n".join((*lines, "</svg>\n"))


def owners() -> str:
    """Return the tables of columns as Markdown: of each table a line for all columns that the same modules write.

    The longest line of ``MANY`` columns or more comes last, without their names.
    """
    lines = []
    for name, columns in TABLES.items():
        written: dict[tuple[str, ...], list[str]] = defaultdict(list)
        for column in columns:
            written[column.writers].append(f"`{column.name}`")
        lines += [f"**{name}**", ""]
        rest = max(written, key=lambda writers: len(written[writers]))
        if len(written[rest]) >= MANY:
            written.pop(rest)
            written[rest] = ["all others" if written else "all"]
        for writers, names in written.items():
            modules = ", ".join(f"`{writer}`" for writer in writers)
            lines.append(f"- {', '.join(names)}: {modules}")
        lines.append("")
    return "\n".join(lines)


def page() -> str:
    """Return docs/developing.md with the table as it is now."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    return before + BEGIN + owners() + END + rest.partition(END)[2]


if __name__ == "__main__":
    DRAWING.write_text(svg(), encoding="utf-8")
    PAGE.write_text(page(), encoding="utf-8")
