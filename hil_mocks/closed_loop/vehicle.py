"""Dynamics of the vehicle for a commanded speed: delay, lag, acceleration limits, and steering along its course."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hil_mocks.closed_loop.course import Course
from lcf_edge.rendered.drives import Floats

_PULL_PER_M2 = 0.8  # curvature per metre of lateral error
_DAMPING_PER_M = 2 * math.sqrt(_PULL_PER_M2)  # and per radian of heading error


@dataclass(frozen=True, slots=True)
class Build:
    """Properties of the vehicle; the camera is above the point that moves along the heading."""

    kind: Literal["differential", "bicycle"] = "differential"
    half_width_m: float = 0.3
    length_m: float = 0.7  # all of it behind the camera
    wheelbase_m: float = 0.5  # of the bicycle
    acceleration_mps2: float = 1.0
    braking_mps2: float = 2.5  # the most
    delay_s: float = 0.15  # from an image to the first effect of its decision
    drive_lag_s: float = 0.12
    steering_lag_s: float = 0.12
    steering_radps: float = 1.5  # fastest turn of the bicycle's wheel
    max_steering_rad: float = 0.6


class Vehicle:
    """Position and motion of the vehicle. World axes as in `lcf_edge.rendered.drives`; headings left positive, rad."""

    def __init__(self, build: Build, course: Course, speed_mps: float = 0.0) -> None:
        self.build, self.course = build, course
        self.position: Floats = np.array(course.place(0.0))
        self.heading_rad = course.heading(0.0)
        self.speed_mps, self.acceleration_mps2 = speed_mps, 0.0
        self.yaw_rate_radps = 0.0
        self.travelled_m = 0.0  # along its course
        self.wheels_m = [0.0, 0.0]  # way of the left and of the right wheel
        self._steering_rad = 0.0
        self._target_mps = speed_mps
        self._commands: deque[tuple[float, float]] = deque()  # when it takes effect, speed

    @property
    def ahead(self) -> Floats:
        """Unit vector of the heading, (x, z)."""
        return np.array([-math.sin(self.heading_rad), math.cos(self.heading_rad)])

    @property
    def axes(self) -> Floats:
        """(2, 2): carries (x, z) into (right, ahead)."""
        x, z = self.ahead.tolist()
        return np.array([[z, -x], [x, z]])

    @property
    def footprint(self) -> Floats:
        """(4, 2) corners (x, z) in m: back left, back right, front right, front left."""
        half, length = self.build.half_width_m, self.build.length_m
        corners = np.array([[-half, -length], [half, -length], [half, 0.0], [-half, 0.0]])
        return self.position + corners @ self.axes

    def command(self, time_s: float, speed_mps: float) -> None:
        """Command a speed, decided on the image of a time."""
        self._commands.append((time_s + self.build.delay_s, max(speed_mps, 0.0)))

    def step(self, time_s: float, dt_s: float, track_m: float) -> None:
        """Advance by one step from a time on."""
        while self._commands and self._commands[0][0] <= time_s + 1e-9:
            self._target_mps = self._commands.popleft()[1]
        build, before = self.build, self.speed_mps
        acceleration = (self._target_mps - before) / build.drive_lag_s
        self.acceleration_mps2 = min(max(acceleration, -build.braking_mps2), build.acceleration_mps2)
        self.speed_mps = max(before + self.acceleration_mps2 * dt_s, 0.0)
        if self.speed_mps < 1e-3 and self._target_mps == 0.0:  # the brake holds it
            self.speed_mps = 0.0
        self.acceleration_mps2 = (self.speed_mps - before) / dt_s
        speed = (before + self.speed_mps) / 2
        self._steer(speed, dt_s)
        middle = self.heading_rad + self.yaw_rate_radps * dt_s / 2
        self.position += speed * dt_s * np.array([-math.sin(middle), math.cos(middle)])
        self.heading_rad += self.yaw_rate_radps * dt_s
        for wheel, side in enumerate((-1, 1)):
            self.wheels_m[wheel] += (speed + side * self.yaw_rate_radps * track_m / 2) * dt_s
        self.travelled_m = self.course.locate(self.position, self.travelled_m)[0]

    def _steer(self, speed: float, dt_s: float) -> None:
        build, course = self.build, self.course
        _, right_m = course.locate(self.position, self.travelled_m)
        onward = self.travelled_m + speed * build.steering_lag_s
        askew = self.heading_rad - course.heading(self.travelled_m)
        curvature = course.curvature(onward) + _PULL_PER_M2 * right_m - _DAMPING_PER_M * askew
        share = -math.expm1(-dt_s / build.steering_lag_s)
        if build.kind == "bicycle":
            angle = math.atan(build.wheelbase_m * curvature)
            angle = min(max(angle, -build.max_steering_rad), build.max_steering_rad)
            most = build.steering_radps * dt_s
            self._steering_rad += min(max(share * (angle - self._steering_rad), -most), most)
            self.yaw_rate_radps = speed * math.tan(self._steering_rad) / build.wheelbase_m
        else:
            self.yaw_rate_radps += share * (curvature * speed - self.yaw_rate_radps)
            if speed == 0.0:
                self.yaw_rate_radps = 0.0
