"""``python -m benchmarks.copies RECORDINGS INTO``: copies of recordings that differ in light, noise or start.

Whether something is found in one run may hang on a single corner. The mean over copies that a user would call the same
recording tells two versions of the filter apart: ``lcf-edge evaluate INTO`` scores them. With ``--camera`` the
images are those of a worse camera; with ``--sensors`` they stay, but IMU or odometry fail. EuRoC/ASL folders are
copied; other recordings, and folders without a file ``settings``, are left out.
"""

import argparse
import json
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.corners.repeats import Repeats
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


def _for_channels(values: npt.NDArray[Any], image: Grey) -> npt.NDArray[Any]:
    """(height, width) values, to be combined with an image that may have channels."""
    return values.reshape(*values.shape, *(1 for _ in image.shape[2:]))


def _shaded(image: Grey, light: npt.NDArray[Any]) -> Grey:
    return np.clip(image * _for_channels(light, image), 0, 255).astype(np.uint8)


def _defects(share: float, grey: int) -> Alteration:
    """Pixels that are stuck, the same in every image."""

    def stick(image: Grey, random: np.random.Generator) -> Grey:
        del random
        stuck = np.random.default_rng(1).random(image.shape[:2]) < share
        return np.where(_for_channels(stuck, image), grey, image).astype(np.uint8)

    return stick


def _exposure(image: Grey, random: np.random.Generator) -> Grey:
    return np.clip(image * random.uniform(0.85, 1.15), 0, 255).astype(np.uint8)


def _bands(image: Grey, random: np.random.Generator) -> Grey:
    """Horizontal bands, as lamps on mains make with a rolling shutter."""
    height, width = image.shape[:2]
    phase = 2 * np.pi * (2.3 * np.arange(height) / height + random.random())
    return _shaded(image, np.repeat(1 + 0.1 * np.sin(phase)[:, None], width, axis=1))


def _vignetting(image: Grey, random: np.random.Generator) -> Grey:
    """Down to 70 % at the middle of each side, 40 % in the corners of the image."""
    del random
    down, across = (np.linspace(-1, 1, size) ** 2 for size in image.shape[:2])
    return _shaded(image, 1 - 0.3 * (down[:, None] + across))


def _dust(image: Grey, random: np.random.Generator) -> Grey:
    """Twelve soft spots on the lens, the same in every image."""
    del random
    (height, width), place = image.shape[:2], np.random.default_rng(0)
    light = np.ones((height, width), np.float32)
    for _ in range(12):
        at = int(place.uniform(0, width)), int(place.uniform(0, height))
        radius = max(2, int(place.uniform(0.005, 0.02) * width))
        cv2.circle(light, at, radius, float(place.uniform(0.5, 0.8)), cv2.FILLED)
    return _shaded(image, cv2.GaussianBlur(light, (0, 0), max(1.0, width / 160)))


def _sharpened(image: Grey, random: np.random.Generator) -> Grey:
    del random
    soft = cv2.GaussianBlur(image, (0, 0), 1.0).astype(float)
    return np.clip(1.8 * image - 0.8 * soft, 0, 255).astype(np.uint8)


CAMERAS: dict[str, Alteration] = {
    "hot-pixels": _defects(0.0005, 255),
    "many-hot-pixels": _defects(0.003, 255),
    "dead-pixels": _defects(0.001, 0),
    "exposure": _exposure,
    "bands": _bands,
    "vignetting": _vignetting,
    "dust": _dust,
    "sharpened": _sharpened,
}
SELECTIONS = {f"from-{first}": slice(first, None) for first in range(10, 61, 10)}
SELECTIONS |= {"every-second": slice(None, None, 2)}
DROPPED = 5  # one image in so many

Rows = list[list[str]]
IMU, ODOMETRY = "mav0/imu0", "mav0/odom0"
DRIFT_RADPS, BIAS_RADPS = 0.035, 0.087  # 2 °/s by the end; 5 °/s


def _add_rate(rows: Rows, offset_radps: Callable[[float], float]) -> Rows:
    """Add to the axes that the gyro has. ``offset_radps``: by the share of the recording that has passed."""
    measured = [any(float(row[axis]) for row in rows) for axis in (1, 2, 3)]
    changed = []
    for number, row in enumerate(rows):
        offset = offset_radps(number / len(rows))
        rates = (float(rate) + has * offset for rate, has in zip(row[1:4], measured, strict=True))
        changed.append([row[0], *map(str, rates), *row[4:]])
    return changed


def _stick(rows: Rows) -> Rows:
    middle = len(rows) // 2
    return [*rows[:middle], *([row[0], *rows[middle][1:]] for row in rows[middle:])]


# What happens to the samples of a sensor; None: there are none.
FAILURES: dict[str, dict[str, Callable[[Rows], Rows] | None]] = {
    "gyro-drifts": {IMU: lambda rows: _add_rate(rows, lambda share: share * DRIFT_RADPS)},
    "gyro-biased": {IMU: lambda rows: _add_rate(rows, lambda _: BIAS_RADPS)},
    "imu-dies": {IMU: lambda rows: rows[: len(rows) // 2]},
    "imu-sticks": {IMU: _stick},
    "no-imu": {IMU: None},
    "no-turn": {IMU: None, ODOMETRY: lambda rows: [[*row[:2], "nan"] for row in rows]},
    "no-odometry": {ODOMETRY: None},
}


def lines_of(path: Path) -> tuple[list[str], list[str]]:
    """Comments and rows of a CSV file."""
    lines = [line for line in path.read_text("utf-8").splitlines() if line.strip()]
    return [line for line in lines if line[0] == "#"], [line for line in lines if line[0] != "#"]


def copy_all_but_images(recording: Path, copy: Path) -> None:
    """Copy an ASL recording, with an empty folder of images."""
    shutil.copytree(recording, copy, ignore=lambda folder, _: ["data"] if Path(folder).name == "cam0" else [])
    (copy / "mav0/cam0/data").mkdir()


def write_image(path: Path, image: Grey) -> None:
    """Write an image under any name, without the losses of a second compression."""
    written = path.with_suffix(".png")
    cv2.imwrite(str(written), image)
    written.rename(path)


def write(recording: Path, into: Path) -> Iterator[str]:
    """Write all copies of an ASL recording into a folder; yield the name of each.

    Raises ``OSError``, and ``RecordingError`` for an image, or a row of one, that is none.
    """
    head, rows = lines_of(recording / "mav0/cam0/data.csv")
    selections = {name: rows[chosen] for name, chosen in SELECTIONS.items()}
    selections["dropped"] = [row for number, row in enumerate(rows) if number % DROPPED]
    for name, chosen in selections.items():
        copy = into / f"{recording.name}@{name}"
        copy_all_but_images(recording, copy)
        (copy / "mav0/cam0/data.csv").write_text("\n".join([*head, *chosen]) + "\n", "utf-8")
        _copy_images(recording, copy, chosen, None)
        _keep_truth(copy / "truth.jsonl", {_image_of(recording, row)[0] for row in chosen})
        yield copy.name
    yield from write_altered(recording, into, ALTERATIONS)


def write_altered(
    recording: Path, into: Path, alterations: dict[str, Alteration], *, by_camera: bool = False
) -> Iterator[str]:
    """Write copies whose images are altered, else as ``write``. ``by_camera``: what repeats, repeats as altered."""
    _, rows = lines_of(recording / "mav0/cam0/data.csv")
    for name, alteration in alterations.items():
        copy = into / f"{recording.name}@{name}"
        copy_all_but_images(recording, copy)
        _copy_images(recording, copy, rows, alteration, Repeats() if by_camera else None)
        yield copy.name


def write_worse(recording: Path, into: Path) -> Iterator[str]:
    """Write copies as by worse cameras, else as ``write``."""
    return write_altered(recording, into, CAMERAS, by_camera=True)


def write_failing(recording: Path, into: Path) -> Iterator[str]:
    """Write copies of an ASL recording whose sensors fail, as far as it has them; yield the name of each.

    Raises ``OSError``, and ``RecordingError`` for a row that is no sample.
    """
    for name, failures in FAILURES.items():
        if not all((recording / sensor).is_dir() for sensor in failures):
            continue
        copy = into / f"{recording.name}@{name}"
        shutil.copytree(recording, copy)
        for sensor, change in failures.items():
            if change is None:
                shutil.rmtree(copy / sensor)
                continue
            path = copy / sensor / "data.csv"
            head, rows = lines_of(path)
            try:
                changed = change([row.split(",") for row in rows])
            except (ValueError, IndexError) as error:
                raise RecordingError(f"{recording / sensor}/data.csv: a row is no sample: {error}") from error
            path.write_text("\n".join([*head, *map(",".join, changed)]) + "\n", "utf-8")
        yield copy.name


def _copy_images(
    recording: Path, copy: Path, rows: Sequence[str], alteration: Alteration | None, repeats: Repeats | None = None
) -> None:
    random = np.random.default_rng(0)
    altered = np.empty((0, 0), np.uint8)
    for row in rows:
        stamp_ns, name = _image_of(recording, row)
        if alteration is None:
            shutil.copyfile(recording / name, copy / name)
            continue
        image = cv2.imread(str(recording / name), cv2.IMREAD_UNCHANGED)
        if image is None:
            raise RecordingError(f"{recording / name}: no image")
        image = np.asarray(image, np.uint8)
        if repeats is None or not repeats.is_repeat(stamp_ns, image.reshape(len(image), -1)):
            altered = alteration(image, random)
        write_image(copy / name, altered)


def _image_of(recording: Path, row: str) -> tuple[int, Path]:
    """Stamp, ns, and file of an image, by its row."""
    stamp_ns, _, name = row.partition(",")
    try:
        return int(stamp_ns), Path("mav0/cam0/data", name.partition(",")[0].strip())
    except ValueError as error:
        raise RecordingError(f"{recording / 'mav0/cam0/data.csv'}: a row is no image: {row!r}") from error


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
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--camera", action="store_true", help="copies whose camera is worse")
    kind.add_argument("--sensors", action="store_true", help="copies whose IMU or odometry fails")
    options = parser.parse_args(arguments)
    write_copies = write_failing if options.sensors else write_worse if options.camera else write
    try:
        found = [each.path for each in find([options.recordings]) if each.settings]
        written = 0
        for path in found:
            if (path / "mav0/cam0/data.csv").is_file():
                written += sum(1 for _ in write_copies(path, options.into))
        sys.stdout.write(f"{written} copies in {options.into}: lcf-edge evaluate {options.into}\n")
    except (LcfError, OSError) as error:
        sys.stderr.write(f"benchmarks.copies: {error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
