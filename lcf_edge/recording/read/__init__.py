"""Reading recordings: EuRoC/ASL folders, MCAP files with ROS 2 messages, videos, folders of images.

``recording`` is what they have in common; ``asl``, ``rosbag`` and ``images`` are the kinds. ``decoding``
turns encoded images into luminance, ``mcap_file`` finds the messages of a damaged file, ``sensor_yaml`` and
``distortion`` read calibrations.
"""

from pathlib import Path

from lcf_edge.config import Config
from lcf_edge.errors import RecordingError
from lcf_edge.recording.read.asl import AslRecording, is_asl_folder
from lcf_edge.recording.read.images import VIDEO_SUFFIXES, ImageFolder, VideoFile, is_image
from lcf_edge.recording.read.recording import Recording
from lcf_edge.recording.read.rosbag import RosBag, bag_files

__all__ = ["Recording", "is_recording", "open_recording"]


def is_recording(path: Path) -> bool:
    """Whether it is one recording, by its name and contents. Raises ``OSError``.

    A folder of MCAP files is one when ``metadata.yaml`` says that they belong together; else each file is one.
    """
    if path.is_dir():
        is_bag = (path / "metadata.yaml").is_file() and bool(bag_files(path))
        return is_bag or is_asl_folder(path) or any(map(is_image, path.iterdir()))
    return path.suffix.lower() in {".mcap", *VIDEO_SUFFIXES} and path.is_file()


def open_recording(path: Path, config: Config) -> Recording:
    """Open the recording at ``path``, of whichever kind it is. Raises ``RecordingError``."""
    try:
        return _open(path, config)
    except OSError as error:
        where = error.filename or path
        raise RecordingError(f"{where}: cannot be read ({error.strerror}); check file and medium") from error


def _open(path: Path, config: Config) -> Recording:
    if path.is_dir():
        if is_asl_folder(path):
            return AslRecording(path, config)
        return RosBag(path, config) if bag_files(path) else ImageFolder(path, config)
    if not path.is_file():
        raise RecordingError(f"{path}: no such file or folder; name a recording")
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        return RosBag(path, config)
    if suffix in VIDEO_SUFFIXES:
        return VideoFile(path, config)
    raise RecordingError(
        f"{path}: not a recording; name an mcap file, a video, a folder of images or one with mav0 in it"
    )
