"""A small program in place of the daemon, for what installs it: a wheel of the same name with the same command."""

import zipfile
from pathlib import Path

PROGRAM = """def main():
    print("lcf-edge {version}")
"""


def wheel_of(folder: Path, version: str, program: str = PROGRAM) -> Path:
    """Write the wheel into ``folder``. ``program``: the package's one file, with ``main()``; {version} is replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    about = f"lcf_edge-{version}.dist-info"
    files = {
        "lcf_edge/__init__.py": program.replace("{version}", version),
        f"{about}/METADATA": f"Metadata-Version: 2.1\nName: lcf-edge\nVersion: {version}\n",
        f"{about}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{about}/entry_points.txt": "[console_scripts]\nlcf-edge = lcf_edge:main\n",
    }
    files[f"{about}/RECORD"] = "".join(f"{name},,\n" for name in [*files, f"{about}/RECORD"])
    wheel = folder / f"lcf_edge-{version}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in files.items():
            archive.writestr(zipfile.ZipInfo(name), text)  # with a constant time stamp
    return wheel
