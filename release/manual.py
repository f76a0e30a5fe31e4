"""``python -m release.manual``: the manual page and the completions for bash, zsh and fish, into ``share/``.

Made of the options that the program itself reads, by Python 3.11, and kept in the repository, so that nobody who
installs needs the tools that make them. ``share/`` goes into the wheel as it is: below a prefix like ``/usr/local``
these are the places in which ``man`` and the shells look.
"""

import argparse
import re
import sys
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import shtab
from argparse_manpage.manpage import Manpage

from lcf_edge import __version__
from lcf_edge.cli.arguments import parser

_COLUMNS = 68
_MORE = """
.SH EXIT STATUS
0 done; 1 failed at run time; 2 wrong usage or configuration; 130 interrupted; 141 the reader of the output went away.
.SH FILES
.TP
/etc/lcf-edge/config.toml
the configuration, where no other one is named
.TP
/var/lib/lcf-edge
what the daemon keeps
"""

FOLDER = Path(__file__).parents[1] / "share"
MANUAL = "man/man1/lcf-edge.1"
COMPLETIONS = {
    "bash": "bash-completion/completions/lcf-edge",
    "zsh": "zsh/site-functions/_lcf-edge",
    "fish": "fish/vendor_completions.d/lcf-edge.fish",
}


def files() -> Mapping[str, str]:
    """What each file below ``share/`` should hold."""
    return {MANUAL: _manual(), **{path: _completion(shell) for shell, path in COMPLETIONS.items()}}


def _completion(shell: str) -> str:
    program = parser()
    for action in (action for part in _parts(program) for action in part._actions):
        if action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]  # shtab looks for it
    return shtab.complete(program, shell=shell).rstrip() + "\n"


def _manual() -> str:
    program = parser()
    for part in _parts(program):
        part.formatter_class = partial(argparse.HelpFormatter, width=_COLUMNS)
    program.man_short_description = "the Line-Circle filter, for a small vehicle's computer"  # type: ignore[attr-defined]
    about = {"project_name": "lcf-edge", "date": __version__, "manual_title": "lcf-edge"}
    page = str(Manpage(program, about, format="single-commands-section")).rstrip()
    page = page.replace("POSITIONAL ARGUMENTS", "COMMANDS")
    return re.sub(r"-\n(?=\w)", "-", page) + _MORE  # argparse breaks words at hyphens


def _parts(program: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """The program's own options, and those of its commands; argparse tells them in no other way."""
    yield program
    for action in program._actions:
        if isinstance(action, argparse._SubParsersAction):
            for part in action.choices.values():
                yield from _parts(part)


def main() -> int:
    """Write them; return the exit status."""
    for name, text in files().items():
        path = FOLDER / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        sys.stdout.write(f"{path.relative_to(FOLDER.parent)}: {len(text)} bytes\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
