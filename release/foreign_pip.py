"""What tells pip to take what fits another computer: its processor, its Python, its C library."""

from packaging.markers import Marker

OF_TODAY = 41  # 2.41: Debian 13's, and newer ones have all of it
OF_DEBIAN_12 = 36


def options_for(processor: str, python: str, newest_libc: int = OF_TODAY) -> list[str]:
    """For ``pip install --target`` and ``pip download``. ``newest_libc``: 36 is glibc 2.36."""
    libraries = ["manylinux2014", *(f"manylinux_2_{minor}" for minor in range(17, newest_libc + 1))]
    platforms = [f"--platform={library}_{processor}" for library in libraries]
    return [*platforms, "--only-binary=:all:", "--implementation=cp", f"--python-version={python}"]


def command_for(python: str) -> str:
    """The script ``lcf-edge`` for that Python; pip would write it for the one that runs it."""
    return f"#!{python}\nfrom lcf_edge.cli.command_line import program\n\nprogram()\n"


def locked_for(lock: str, python: str) -> str:
    """The requirements of a lock that are meant for that Python on Linux; pip would ask the Python that runs it."""
    environment = {"python_version": python, "python_full_version": f"{python}.0", "sys_platform": "linux"}
    kept = []
    for requirement in lock.replace("\\\n", " ").splitlines():
        wanted, _, rest = requirement.partition(";")
        marker, _, hashes = rest.partition("--hash")
        if not rest or Marker(marker).evaluate(environment):
            kept.append(f"{wanted} --hash{hashes}" if hashes else requirement)
    return "\n".join(kept) + "\n"
