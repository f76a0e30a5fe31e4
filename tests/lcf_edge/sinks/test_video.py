"""The video of the overlay."""

import base64
import importlib.util
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from lcf_edge.errors import UsageError
from lcf_edge.sinks import SinkError
from lcf_edge.sinks.video import SUFFIXES, VideoSink

GREYS = range(0, 240, 20)


def filmed(path: Path, height: int = 48, width: int = 128, rate: float = 29.97) -> Path:
    with VideoSink(path, rate) as video:
        for grey in GREYS:
            video.write(np.full((height, width, 3), grey, np.uint8))
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("odd", [0, 1])
def test_the_video_holds_every_frame(tmp_path: Path, suffix: str, odd: int) -> None:
    path = filmed(tmp_path / f"overlay{suffix}", 48 + odd, 128 + odd)
    capture = cv2.VideoCapture(str(path))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(29.97, abs=0.01)
    frames = [frame for got, frame in iter(capture.read, (False, None)) if got]
    capture.release()
    assert [frame.shape for frame in frames] == [(48, 128, 3)] * 12
    assert [frame.mean() for frame in frames] == pytest.approx(GREYS, abs=4)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_browser_plays_it(tmp_path: Path, suffix: str, browser: Any) -> None:
    path = filmed(tmp_path / f"overlay{suffix}", rate=20)
    data = base64.b64encode(path.read_bytes()).decode()
    browser.open("about:blank")
    browser.evaluate(
        f"""(document.body.innerHTML = '<video muted></video>',
             document.querySelector('video').src = 'data:video/{suffix[1:]};base64,{data}',
             document.querySelector('video').play())"""
    )
    browser.wait_for("document.querySelector('video').ended")
    video = "(({readyState, duration, videoWidth, videoHeight, error}) => [readyState, duration, videoWidth, " + (
        "videoHeight, error])(document.querySelector('video'))"
    )
    ready, duration_s, *rest = browser.evaluate(video)
    assert ready >= 2  # it has the image of where it is
    assert duration_s == pytest.approx(12 / 20, abs=0.06)
    assert rest == [128, 48, None]


def test_no_file_says_what_it_begins_with(tmp_path: Path) -> None:
    """A replay without one image leaves nothing behind."""
    with VideoSink(tmp_path / "overlay.webm", 20):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_video_under_a_wrong_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"overlay\.avi: the name must end in \.webm or \.mp4"):
        VideoSink(tmp_path / "overlay.avi", 20)


def test_without_pyav_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r"overlay\.webm: a video needs PyAV: pip install 'lcf-edge\[video\]'"):
        VideoSink(tmp_path / "overlay.webm", 20)


def test_a_video_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(SinkError, match=r"nowhere/overlay\.webm: cannot be written \(No such file"):
        VideoSink(tmp_path / "nowhere" / "overlay.webm", 20)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_full_disk_does_not_pass_for_a_video(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"overlay{suffix}"
    path.symlink_to("/dev/full")
    with (
        pytest.raises(SinkError, match=rf"overlay{suffix}: the video cannot be written"),
        VideoSink(path, 20) as video,
    ):
        video.write(np.zeros((48, 64, 3), np.uint8))
