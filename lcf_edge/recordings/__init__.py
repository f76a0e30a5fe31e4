"""Reading recordings: EuRoC/ASL folders, MCAP files with ROS 2 messages, videos, folders of pictures.

``recording`` is what they have in common; ``asl``, ``rosbag`` and ``pictures`` are the kinds. ``decoding``
makes luminance of pictures, ``mcap_file`` finds the messages of a damaged file, ``sensor_yaml`` and
``distortion`` read calibrations.
"""

from pathlib import Path

from lcf_edge.config import Config
from lcf_edge.errors import RecordingError
from lcf_edge.recordings.asl import AslRecording, is_asl_folder
from lcf_edge.recordings.pictures import VIDEO_SUFFIXES, PictureFolder, VideoFile
from lcf_edge.recordings.recording import Recording
from lcf_edge.recordings.rosbag import RosBag, bag_files

__all__ = ["Recording", "open_recording"]


def open_recording(path: Path, config: Config) -> Recording:
    """The recording at ``path``, of the kind that is found there. Raises ``RecordingError``."""
    try:
        return _open(path, config)
    except OSError as error:
        where = error.filename or path
        raise RecordingError(f"{where}: cannot be read ({error.strerror}); check file and medium") from error


def _open(path: Path, config: Config) -> Recording:
    if path.is_dir():
        if is_asl_folder(path):
            return AslRecording(path, config)
        return RosBag(path, config) if bag_files(path) else PictureFolder(path, config)
    if not path.is_file():
        raise RecordingError(f"{path}: no such file or folder; name a recording")
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        return RosBag(path, config)
    if suffix in VIDEO_SUFFIXES:
        return VideoFile(path, config)
    raise RecordingError(
        f"{path}: not a recording; name an mcap file, a video, a folder of pictures or one with mav0 in it"
    )
