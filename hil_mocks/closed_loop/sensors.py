"""The vehicle's sensors: pose of a shaken camera, IMU, wheel odometry."""

import math

import numpy as np

from drivers.samples import ImuSample, SpeedSample
from hil_mocks.closed_loop.vehicle import Vehicle
from hil_mocks.closed_loop.world import World
from lcf_edge.rendered.drives import Floats, stamp_ns
from lcf_edge.rendered.trajectory import GRAVITY_MPS2, body_rates, rotation

IMU_HZ = 200
ODOMETRY_EVERY = 4  # of the IMU's samples
_RATTLE_RADPS, _RATTLE_MPS2 = 0.004, 0.15  # 1 sigma a sample at 1 m/s, besides the sines
_WALK_RADPS = 3e-4  # of the gyro's bias, 1 sigma in a second
_MAX_SHAKEN_MPS = 2.0  # speed from which shaking does not increase


class Sensors:
    """The camera's pose and the samples, from the vehicle's true motion."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._random = np.random.default_rng([world.seed, 11])
        self._bias: Floats = np.array(world.noise.gyro_bias_radps)
        self._ticks = (0, 0)
        self._count = 0

    def pose(self, time_s: float, vehicle: Vehicle) -> tuple[Floats, Floats]:
        """The camera's attitude (3, 3), camera to world, and position (3,), m."""
        (yaw, pitch, roll, heave), _, _ = self._shaking(time_s, vehicle)
        angles = (np.array([value]) for value in (yaw - vehicle.heading_rad, pitch, roll))
        x, z = vehicle.position.tolist()
        return rotation(*angles)[0], np.array([x, -self._world.camera_height_m - heave, z])

    def sample(self, time_s: float, vehicle: Vehicle) -> list[ImuSample | SpeedSample]:
        """Return the samples at a time; call it at `IMU_HZ`."""
        samples: list[ImuSample | SpeedSample] = []
        if self._world.gyro:
            samples.append(self._inertial(time_s, vehicle))
        if self._count % ODOMETRY_EVERY == 0 and self._world.odometry:
            samples.append(self._wheels(time_s, vehicle))
        self._count += 1
        return samples

    def _inertial(self, time_s: float, vehicle: Vehicle) -> ImuSample:
        noise, random = self._world.noise, self._random
        (yaw, pitch, roll, _), rates, heave_mps2 = self._shaking(time_s, vehicle)
        yaw_rate = rates[0] - vehicle.yaw_rate_radps
        columns = (np.array([value]) for value in (pitch, roll, yaw_rate, rates[1], rates[2]))
        centripetal = vehicle.speed_mps * vehicle.yaw_rate_radps
        ahead = vehicle.ahead
        x, z = (vehicle.acceleration_mps2 * ahead + centripetal * np.array([-ahead[1], ahead[0]])).tolist()
        attitude = rotation(*(np.array([value]) for value in (yaw - vehicle.heading_rad, pitch, roll)))[0]
        force = attitude.T @ (x, -heave_mps2 - GRAVITY_MPS2, z)
        rattle = min(vehicle.speed_mps, _MAX_SHAKEN_MPS)
        self._bias += random.normal(0, _WALK_RADPS / math.sqrt(IMU_HZ), 3)
        gyro = body_rates(*columns)[0] + self._bias
        gyro += random.normal(0, math.hypot(noise.gyro_radps, rattle * _RATTLE_RADPS), 3)
        force += noise.accel_bias_mps2
        force += random.normal(0, math.hypot(noise.accel_mps2, rattle * _RATTLE_MPS2), 3)
        return ImuSample(stamp_ns(time_s), tuple(gyro.tolist()), tuple(force.tolist()))

    def _wheels(self, time_s: float, vehicle: Vehicle) -> SpeedSample:
        """Whole ticks of two wheels since the last reading; of the bicycle the yaw rate is that of its steering."""
        world = self._world
        elapsed_s = ODOMETRY_EVERY / IMU_HZ
        scale = world.ticks_per_m * world.noise.speed_scale
        left, right = (math.floor(way * scale) for way in vehicle.wheels_m)
        gone = (left - self._ticks[0]) / world.ticks_per_m, (right - self._ticks[1]) / world.ticks_per_m
        self._ticks = left, right
        yaw_rate = (gone[1] - gone[0]) / elapsed_s / world.track_m
        if world.build.kind == "bicycle":
            still = vehicle.speed_mps == 0
            yaw_rate = (
                0.0 if still else vehicle.yaw_rate_radps * world.noise.speed_scale + self._random.normal(0, 0.005)
            )
        return SpeedSample(stamp_ns(time_s), sum(gone) / 2 / elapsed_s, yaw_rate)

    def _shaking(self, time_s: float, vehicle: Vehicle) -> tuple[list[float], list[float], float]:
        """Yaw, pitch, roll (rad) and heave (m); rates of the angles, rad/s; acceleration of the heave, m/s²."""
        share = min(vehicle.speed_mps, _MAX_SHAKEN_MPS)
        growth = vehicle.acceleration_mps2 if vehicle.speed_mps < _MAX_SHAKEN_MPS else 0.0
        place = {"yaw": 0.0, "pitch": self._world.camera_pitch_rad, "roll": 0.0, "heave": 0.0}
        rate = dict.fromkeys(place, 0.0)
        heave_mps2 = 0.0
        for shake in self._world.shakes:
            omega = math.tau * shake.frequency_hz
            sine, cosine = (f(omega * time_s + shake.phase_rad) for f in (math.sin, math.cos))
            place[shake.axis] += share * shake.amplitude * sine
            rate[shake.axis] += shake.amplitude * (share * omega * cosine + growth * sine)
            if shake.axis == "heave":
                heave_mps2 += shake.amplitude * omega * (2 * growth * cosine - share * omega * sine)
        return list(place.values()), list(rate.values()), heave_mps2
