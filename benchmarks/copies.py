"""``python -m benchmarks.copies RECORDINGS INTO``: copies of recordings that differ in light, noise or start.

Whether something is found in one run may hang on a single corner. The mean over copies that a user would call the same
recording tells two versions of the filter apart: ``lcf-edge evaluate INTO`` scores them. EuRoC/ASL folders are copied;
other recordings, and folders without a file ``settings``, are left out.
"""

import argparse
import json
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.errors import LcfError, RecordingError
from lcf_edge.evaluate.corpus import find

Grey = npt.NDArray[np.uint8]
Alteration = Callable[[Grey, np.random.Generator], Grey]


def _gamma(exponent: float) -> Alteration:
    table = np.round(255 * (np.arange(256) / 255) ** exponent).astype(np.uint8)
    return lambda image, _: table[image]


def _noise(sigma_grey: float) -> Alteration:
    return lambda image, random: np.clip(image + random.normal(0, sigma_grey, image.shape), 0, 255).astype(np.uint8)


def _blur(sigma_px: float) -> Alteration:
    return lambda image, _: np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), np.uint8)


def _jpeg(quality: int) -> Alteration:
    def compress(image: Grey, random: np.random.Generator) -> Grey:
        del random
        _, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
        return np.asarray(cv2.imdecode(encoded, cv2.IMREAD_UNCHANGED), np.uint8)

    return compress


ALTERATIONS: dict[str, Alteration] = {
    "brighter": _gamma(0.6),
    "darker": _gamma(1.5),
    "less-contrast": lambda image, _: (0.6 * image).astype(np.uint8),
    "blurred-slightly": _blur(0.5),
    "blurred": _blur(0.8),
    "jpeg-70": _jpeg(70),
    "jpeg-40": _jpeg(40),
    "noise-1": _noise(1.0),
    "noise-2": _noise(2.0),
    "noise-3": _noise(3.0),
}
SELECTIONS = {f"from-{first}": slice(first, None) for first in range(10, 61, 10)}
SELECTIONS |= {"every-second": slice(None, None, 2)}
DROPPED = 5  # one image in so many


def write(recording: Path, into: Path) -> Iterator[str]:
    """Write all copies of an ASL recording into a folder; yield the name of each. Raises ``OSError``."""
    source = recording / "mav0/cam0/data.csv"
    lines = [line for line in source.read_text("utf-8").splitlines() if line.strip()]
    head, rows = [line for line in lines if line.startswith("#")], [line for line in lines if line[0] != "#"]
    selections = {name: rows[chosen] for name, chosen in SELECTIONS.items()}
    selections["dropped"] = [row for number, row in enumerate(rows) if number % DROPPED]
    selections |= dict.fromkeys(ALTERATIONS, rows)
    for name, chosen in selections.items():
        copy = into / f"{recording.name}@{name}"
        shutil.copytree(recording, copy, ignore=lambda folder, _: ["data"] if Path(folder).name == "cam0" else [])
        (copy / "mav0/cam0/data.csv").write_text("\n".join([*head, *chosen]) + "\n", "utf-8")
        _copy_images(recording, copy, chosen, ALTERATIONS.get(name))
        _keep_truth(copy / "truth.jsonl", {int(row.split(",")[0]) for row in chosen})
        yield copy.name


def _copy_images(recording: Path, copy: Path, rows: Sequence[str], alteration: Alteration | None) -> None:
    random = np.random.default_rng(0)
    (copy / "mav0/cam0/data").mkdir()
    for row in rows:
        name = Path("mav0/cam0/data", row.split(",")[1].strip())
        if alteration is None:
            shutil.copyfile(recording / name, copy / name)
            continue
        image = cv2.imread(str(recording / name), cv2.IMREAD_UNCHANGED)
        if image is None:
            raise RecordingError(f"{recording / name}: no image")
        written = (copy / name).with_suffix(".png")  # without the losses of a second compression
        cv2.imwrite(str(written), alteration(np.asarray(image, np.uint8), random))
        written.rename(copy / name)


def _keep_truth(path: Path, stamps_ns: set[int]) -> None:
    """Keep the truth of the images that a copy has."""
    if path.is_file():
        lines = [line for line in path.read_text("utf-8").splitlines() if line.strip()]
        kept = [line for line in lines if json.loads(line)["stamp_ns"] in stamps_ns]
        path.write_text("".join(line + "\n" for line in kept), "utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the copies of all recordings; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.copies", description=__doc__)
    parser.add_argument("recordings", type=Path, help="folder of recordings, each a folder with a file settings")
    parser.add_argument("into", type=Path, help="new folder")
    options = parser.parse_args(arguments)
    try:
        found = [each.path for each in find([options.recordings]) if each.settings]
        written = 0
        for path in found:
            if (path / "mav0/cam0/data.csv").is_file():
                written += sum(1 for _ in write(path, options.into))
        sys.stdout.write(f"{written} copies in {options.into}: lcf-edge evaluate {options.into}\n")
    except (LcfError, OSError) as error:
        sys.stderr.write(f"benchmarks.copies: {error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
