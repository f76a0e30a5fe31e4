"""The same attack guided by coverage, with atheris (``pip install lcf-edge[fuzz]``), where that can be had."""

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["lcf_edge", "drivers"]):
    from tests.fuzz.hunt import HANG_S, MEMORY, strict
    from tests.fuzz.targets import TARGETS


def main() -> None:
    """``python -m tests.fuzz.coverage NAME SECONDS SEED FINDINGS``: ends at the first finding, whose input it keeps."""
    name, seconds, seed, findings = sys.argv[1:]
    target = TARGETS[name]
    with tempfile.TemporaryDirectory(dir=MEMORY) as scratch, target.opened(Path(scratch)) as take, strict():
        corpus = Path(scratch, "corpus")
        corpus.mkdir()
        for number, data in enumerate(target.seeds()):
            (corpus / str(number)).write_bytes(data)
        Path(findings).mkdir(parents=True, exist_ok=True)
        options = [
            f"-max_total_time={seconds}",
            f"-seed={int(seed) + 1}",
            "-max_len=65536",
            f"-timeout={HANG_S:.0f}",
            f"-rss_limit_mb={512 + target.grows_mib}",
            f"-artifact_prefix={findings}/",
            "-print_final_stats=1",
        ]
        atheris.Setup([sys.argv[0], *options, str(corpus)], take)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
