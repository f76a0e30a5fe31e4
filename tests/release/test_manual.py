"""The manual page and the completions: they are those of the options, and real shells complete with them."""

import os
import pty
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lcf_edge.cli.arguments import parser
from release import manual

SHARE = manual.FOLDER
COMMANDS = {"demo", "bench", "replay", "evaluate", "run", "record", "watch", "view", "doctor", "calibrate", "config"}
PATIENCE_S = 30.0


def needs(program: str) -> pytest.MarkDecorator:
    return pytest.mark.skipif(shutil.which(program) is None, reason=f"no {program} here")


@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="other Pythons word usage differently")
@pytest.mark.parametrize("name", [manual.MANUAL, *manual.COMPLETIONS.values()])
def test_they_are_those_of_the_options(name: str) -> None:
    assert (SHARE / name).read_text(encoding="utf-8") == manual.files()[name], "make manual"


@needs("man")
def test_the_manual_page_has_every_command_and_no_fault() -> None:
    command = ("man", "--warnings", "--local-file", str(SHARE / manual.MANUAL))
    done = subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, "MANWIDTH": "80"})
    assert done.stderr == ""
    for name in COMMANDS:
        assert f"lcf-edge {name}" in done.stdout
    assert "EXIT STATUS" in done.stdout
    assert "Generated" not in done.stdout


def bash(*words: str) -> set[str]:
    script = (
        f'source "{SHARE / manual.COMPLETIONS["bash"]}"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); '
        "COMP_LINE=\"$*\"; COMP_POINT=${#COMP_LINE}; $(complete -p lcf-edge | sed 's/.*-F \\([^ ]*\\).*/\\1/'); "
        'printf "%s\\n" "${COMPREPLY[@]}"'
    )
    command = ("bash", "--norc", "-c", script, "bash", *words)
    return set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())


def fish(*words: str) -> set[str]:
    command = ("fish", "--no-config", "-c", 'source "$argv[2]"; complete -C "$argv[1]"')
    completions = str(SHARE / manual.COMPLETIONS["fish"])
    done = subprocess.run([*command, " ".join(words), completions], capture_output=True, text=True, check=True)
    return {line.split("\t")[0] for line in done.stdout.splitlines()}


def zsh(*words: str) -> str:
    """The line that begins with these words, after the tab key at a terminal."""
    place = SHARE / "zsh/site-functions"
    leader, follower = pty.openpty()
    environment = {**os.environ, "TERM": "dumb"}
    running = subprocess.Popen(
        ("zsh", "-f", "-i"), stdin=follower, stdout=follower, stderr=follower, env=environment, start_new_session=True
    )
    os.close(follower)
    ends = time.monotonic() + PATIENCE_S

    def until(mark: str, shown: str = "") -> str:
        while mark not in shown:
            assert time.monotonic() < ends, shown
            shown += os.read(leader, 4096).decode(errors="replace")
        return shown

    try:
        widget = 'tell() { print -r -- "<<$BUFFER>>" }; zle -N tell; bindkey "^X" tell'
        setup = f"fpath=({place} $fpath); autoload -Uz compinit; compinit -u -D; {widget}; PS1=REA''DY"
        os.write(leader, f"{setup}\n".encode())
        until("READY")
        os.write(leader, f"{' '.join(words)}\t\x18".encode())
        return until(">>").partition("<<")[2].partition(">>")[0].strip()
    finally:
        os.close(leader)
        running.kill()
        running.wait()


@pytest.mark.parametrize("complete", [pytest.param(bash, marks=needs("bash")), pytest.param(fish, marks=needs("fish"))])
def test_commands_options_and_values_are_completed(complete: "type[bash]", tmp_path: Path) -> None:
    assert complete("lcf-edge", "") >= COMMANDS
    assert complete("lcf-edge", "ev") == {"evaluate"}
    assert complete("lcf-edge", "evaluate", "--sch") == {"--scheduler"}
    assert complete("lcf-edge", "calibrate", "") >= {"camera", "imu", "foe", "time", "mask"}
    assert complete("lcf-edge", "calibrate", "camera", "--model", "equ") == {"equidistant"}
    (tmp_path / "drive.mcap").touch()
    assert complete("lcf-edge", "replay", f"{tmp_path}/dr") == {f"{tmp_path}/drive.mcap"}


@needs("zsh")
def test_commands_options_and_values_are_completed_in_zsh(tmp_path: Path) -> None:
    assert zsh("lcf-edge", "ev") == "lcf-edge evaluate"
    assert zsh("lcf-edge", "evaluate", "--sch") == "lcf-edge evaluate --scheduler"
    assert zsh("lcf-edge", "calibrate", "camera", "--model", "equ") == "lcf-edge calibrate camera --model equidistant"
    (tmp_path / "drive.mcap").touch()
    assert zsh("lcf-edge", "replay", f"{tmp_path}/dr") == f"lcf-edge replay {tmp_path}/drive.mcap"


def test_every_command_of_the_program_is_among_those_that_are_tried() -> None:
    (commands,) = (action.choices for action in parser()._actions if action.dest == "command")
    assert set(commands or ()) >= COMMANDS
