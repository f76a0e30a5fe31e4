"""What degrades the scenes, in words."""

from collections.abc import Iterator

from drivers.samples import Frame
from lcf_edge.config import Config
from lcf_edge.messages import PipelineScene

DARK = 25  # mean grey level of a dark image
_BLIND_S = 0.5  # without corners

_WORDS = {
    "no imu": "no inertial samples: rotation comes from the images alone, and the flow lines are widened; check imu",
    "imu gap": "inertial samples are missing between two images; check the IMU's cable and rate",
    "gyro stuck": "the gyro repeats one value without noise and is ignored; check imu and its wires",
    "imu saturated": "the motion exceeds the IMU's range; raise it, or damp the mounting",
    "gyro lacks an axis": "the gyro does not measure every axis: pitch and roll come from the images alone",
    "gyro bias unknown": "the gyro's bias is not known yet: let the vehicle stand, or show it more than a plain wall",
    "rotation from odometry": "rotation is taken from odometry",
    "no speed": "speed is unknown: ranges and times to contact are not known; check vehicle.speed_source",
    "speed drifts": "speed comes from the accelerometer alone and drifts",
    "speed from ground": "nothing measures the speed: estimated from the ground in the images and camera.height_m",
    "few corners": "few corners: little can be found; the scene is plain or dark, or the lens out of focus",
    "glare": "glare: much of the image is overexposed; lower the exposure, or shade the lens",
    "rolling shutter": "rolling shutter: rows are read over camera_readout_ms, and what is upright leans as the camera "
    "shakes; choose a faster mode, or damp the mounting",
    "glossy floor": "glossy floor: much is seen deep below the ground, as mirrored; or camera.height_m is too low",
    "dirty lens": "dirty lens: drops or dirt stay in place in the image; wipe it, or outline own parts in camera.mask",
    "blurred": "the image is blurred: shaken or turned during exposure; shorten it",
}

_WORDS_OF_A_RECORDING = {  # without mentioning a cable
    "imu gap": "inertial samples are missing between two images of the recording, or where it begins again",
    "gyro stuck": "the gyro of the recording repeats one value without noise and is ignored",
}


class Degradation:
    """Watches the scenes; ``notes``: what is wrong at present, the worst first."""

    def __init__(self, config: Config) -> None:
        self.notes: tuple[str, ...] = ()
        self._words = _WORDS | (_WORDS_OF_A_RECORDING if config.imu.driver == "recording" else {})
        self._leap_px = config.filter.leap_px
        self._depth_m = config.filter.scene_depth_m
        self._last_ns: int | None = None
        self._corners_ns: int | None = None  # when there last were some

    def add(self, frame: Frame, scene: PipelineScene) -> None:
        """Take a frame and what it gave."""
        self.notes = tuple(self._found(frame, scene))
        self._last_ns = frame.stamp_ns

    def _found(self, frame: Frame, scene: PipelineScene) -> Iterator[str]:
        if scene.sizes.corners or self._corners_ns is None:
            self._corners_ns = frame.stamp_ns
        if frame.stamp_ns - self._corners_ns >= _BLIND_S * 1e9:
            grey = float(frame.image[::8, ::8].mean())
            yield (
                f"dark: no corners, the mean grey level is {grey:.0f} of 255; uncover the lens or add light"
                if grey < DARK
                else "blind: no corners; the lens is covered or out of focus, or everything in view is plain"
            )
        if self._last_ns is not None:
            yield from self._too_slow(scene, (frame.stamp_ns - self._last_ns) / 1e9)
        yield from (self._words[note] for note in scene.notes if note in self._words)

    def _too_slow(self, scene: PipelineScene, interval_s: float) -> Iterator[str]:
        """Check the scene's motion per frame, x V dt / Z, at the image's edge and at ``filter.scene_depth_m``."""
        moved_px = scene.image_width / 2 * abs(scene.vehicle_speed) * interval_s / self._depth_m
        if moved_px > self._leap_px:  # false for NaN
            yield (
                f"frame rate too low for the motion: the scenery moves {moved_px:.0f} px from frame to frame, "
                f"{self._leap_px:.0f} can be followed; drive slower or raise camera.fps"
            )
