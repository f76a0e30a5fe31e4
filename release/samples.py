"""``python -m release.samples``: the recordings in ``samples/``, rendered, with the exact truth beside each.

Each is a file as ``lcf-edge record`` writes it, with its configuration in it, and may be used by anybody for anything.
"""

import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Camera, Config, Record, Vehicle, to_toml
from lcf_edge.lens import Lens
from lcf_edge.pipeline import Pipeline
from lcf_edge.recording.write.messages import Encoder, FrameAndScene
from lcf_edge.recording.write.recording_file import RecordingFile
from lcf_edge.rendered import scenes
from lcf_edge.rendered.scenes import Drive, Truth

FOLDER = Path(__file__).parents[1] / "samples"
_FPS = 15.0
_JPEG_QUALITY = 70


def drives() -> Mapping[str, Drive]:
    """Each recording by its name."""
    made = {
        "walkers": scenes.make("two_crossing", 1, seconds=6.0, width=320, height=240, focal_px=277.0),
        "passing": scenes.make("passing", 3, seconds=4.0, width=320, height=240, focal_px=277.0),
    }
    return {name: replace(drive, fps=_FPS) for name, drive in made.items()}


def config_of(drive: Drive) -> Config:
    """What its vehicle's user would write."""
    matrix = drive.lens.matrix
    return Config(
        camera=Camera(
            width=drive.lens.width,
            height=drive.lens.height,
            fps=drive.fps,
            intrinsics=[float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2])],
            height_m=drive.camera_height_m,
            pitch_rad=drive.camera_pitch_rad,
        ),
        vehicle=Vehicle(half_width_m=drive.half_width_m, horizon_s=drive.horizon_s),
        record=Record(jpeg_quality=_JPEG_QUALITY),
    )


def write(drive: Drive, path: Path) -> None:
    """Write a drive, with what the filter makes of it, and its truth beside it. Raises ``FileExistsError``."""
    config = config_of(drive)
    lens = Lens.from_config(config.camera, drive.lens.width, drive.lens.height)
    pipeline = Pipeline(config, lens)
    encoder = Encoder(config, lambda *_: lens)
    began_ns = next(iter(scenes.truths(drive))).stamp_ns
    file = RecordingFile(path, config.publish.prefix, to_toml(config), 0, began_ns)
    lines = []
    for item in _items(drive):
        if isinstance(item, tuple):
            frame, truth = item
            lines.append(_line(truth))
            for message in encoder.encode(FrameAndScene(frame, pipeline.process(frame))):
                file.add(message)
        else:
            pipeline.add(item)
            for message in encoder.encode(item):
                file.add(message)
    file.finish()
    path.with_suffix(".truth.jsonl").write_text("".join(lines), encoding="utf-8")


def _items(drive: Drive) -> Iterator[tuple[Frame, Truth] | ImuSample | SpeedSample]:
    """In the order in which a daemon gets them: before each image the samples up to the first one after it."""
    samples: list[ImuSample | SpeedSample] = [*scenes.imu(drive), *scenes.odometry(drive)]
    samples.sort(key=lambda sample: sample.stamp_ns)
    late_ns = round(1e9 / min(scenes.IMU_HZ, scenes.ODOMETRY_HZ))
    given = 0
    for frame, truth in scenes.frames(drive):
        while given < len(samples) and samples[given].stamp_ns <= frame.stamp_ns + late_ns:
            yield samples[given]
            given += 1
        yield frame, truth


def _line(truth: Truth) -> str:
    things = [
        {
            "name": each.name,
            "box": np.round([*each.box[:2], each.box[0] + each.box[2], each.box[1] + each.box[3]], 1).tolist(),
            "threat": each.target,
        }
        for each in truth.objects
        if each.in_sight
    ]
    return json.dumps({"stamp_ns": truth.stamp_ns, "objects": things}) + "\n"


def main() -> int:
    """Write them anew; return the exit status."""
    FOLDER.mkdir(exist_ok=True)
    for name, drive in drives().items():
        path = FOLDER / f"{name}.mcap"
        path.unlink(missing_ok=True)
        write(drive, path)
        sys.stdout.write(f"{path.relative_to(FOLDER.parent)}: {path.stat().st_size / 1e3:.0f} kB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
