"""The container: its steps are those of ``make``, and what they need is let in."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_what_is_installed_from_is_let_in_and_what_was_built_here_is_not() -> None:
    rules = (ROOT / ".containerignore").read_text(encoding="utf-8").splitlines()
    allowed = {rule[1:].partition("/")[0] for rule in rules if rule.startswith("!")}
    plan = subprocess.run(
        ("make", "--dry-run", "install-program"), cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    copied = re.search(r"cp -Rp --parents (.*?) \"", plan)
    assert copied
    needed = {name for name in copied[1].split() if not name.startswith("build")}
    assert needed | {"Makefile", "requirements.lock", "systemd"} == allowed
    assert rules[0] == "**"
    assert rules[-2:] == ["**/__pycache__", "**/*.so"]


def test_its_steps_name_what_exists() -> None:
    text = (ROOT / "Containerfile").read_text(encoding="utf-8")
    copied = [line.split()[1] for line in text.splitlines() if line.startswith("COPY ") and "--from" not in line]
    assert copied
    assert all((ROOT / name).exists() for name in copied)
    targets = re.findall(r"make -C /source (\S+)", text)
    assert targets
    for target in targets:
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert text.index("USER lcf-edge") < text.index("ENTRYPOINT")  # not root
