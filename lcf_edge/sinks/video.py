"""A video of the overlay that a browser plays.

PyAV writes it: of the formats of OpenCV's own writer, browsers play only VP8 and VP9, for which it takes no options, so
that files are several times as large and each frame takes half a second.
"""

import importlib.util
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, cast

from drivers.samples import Frame
from lcf_edge.errors import UsageError
from lcf_edge.messages import PipelineScene, View
from lcf_edge.sinks import SinkError, check_output
from lcf_edge.sinks.overlay import Image, draw
from lcf_edge.sinks.sink import Sink

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream

_CODECS: dict[str, tuple[str, dict[str, str]]] = {
    ".webm": ("libvpx-vp9", {"deadline": "realtime", "cpu-used": "8", "row-mt": "1", "crf": "42", "b": "0"}),
    ".mp4": ("libx264", {"preset": "veryfast", "crf": "27", "movflags": "+faststart"}),
}
"""Encoder of each suffix, and its options: as fast as the filter on a small computer, favouring size over quality."""

SUFFIXES = tuple(_CODECS)


class VideoSink(Sink):
    """A video at ``frames_per_s``, as large as its first image: VP9 in ``.webm``, H.264 in ``.mp4``.

    The codecs want even sizes: an odd last row or column is cut. Raises ``UsageError`` when PyAV is missing or the
    name ends in neither, ``SinkError`` when the file cannot be written.
    """

    name = "video"

    def __init__(self, path: Path, frames_per_s: float) -> None:
        check_output(path, SUFFIXES)
        if importlib.util.find_spec("av") is None:
            raise UsageError(f"{path}: a video needs PyAV: pip install 'lcf-edge[video]'")
        self.path = path
        self._rate = Fraction(round(100 * frames_per_s), 100)
        self._container: OutputContainer | None = None
        self._stream: VideoStream | None = None

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:
        """Append the overlay of one frame."""
        self.write(draw(frame.image, scene, view()))

    def write(self, image: Image) -> None:
        """Append one image. Raises ``SinkError``."""
        from av import FFmpegError, VideoFrame  # noqa: PLC0415  # loaded only for a video

        rows, columns = (side // 2 * 2 for side in image.shape[:2])
        try:
            stream = self._stream or self._begin(columns, rows)
            assert self._container is not None
            frame = VideoFrame.from_ndarray(image[: stream.height, : stream.width], format="bgr24")
            self._container.mux(stream.encode(frame))
        except FFmpegError as error:
            raise self._failure() from error

    def close(self) -> None:
        """Write what is still in the encoder, and the index. Raises ``SinkError``."""
        container, stream = self._container, self._stream
        self._container = self._stream = None
        if container is None or stream is None:
            return
        from av import FFmpegError  # noqa: PLC0415

        try:
            container.mux(stream.encode())
            container.close()
        except FFmpegError as error:
            raise self._failure() from error

    def _begin(self, columns: int, rows: int) -> "VideoStream":
        import av  # noqa: PLC0415

        codec, options = _CODECS[self.path.suffix.lower()]
        self._container = av.open(str(self.path), "w")
        stream = cast("VideoStream", self._container.add_stream(codec, rate=self._rate, options=options))
        stream.width, stream.height, stream.pix_fmt = columns, rows, "yuv420p"
        self._stream = stream
        return stream

    def _failure(self) -> SinkError:
        return SinkError(f"{self.path}: the video cannot be written; name another file or free the disk")
