"""How the vehicle moves: pose, rotation rate and specific force of the camera at any time, in closed form.

The camera's attitude is R = Ry(-heading) Rx(pitch) Rz(roll), camera to world; the vibration is added to the
angles and to the height. Only the position on the ground is integrated numerically (1 kHz trapezoids).
"""

import numpy as np

from lcf_edge.rendered.drives import Axis, Drive, Floats

GRAVITY_MPS2 = 9.81


def rotation(yaw: Floats, pitch: Floats, roll: Floats) -> Floats:
    """(n, 3, 3) camera to world for angles about y (down), x (right) and z (forward) in rad."""
    cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (np.cos, np.sin))
    rows = [
        [cy * cr + sy * sp * sr, -cy * sr + sy * sp * cr, sy * cp],
        [cp * sr, cp * cr, -sp],
        [-sy * cr + cy * sp * sr, sy * sr + cy * sp * cr, cy * cp],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def body_rates(pitch: Floats, roll: Floats, yaw_rate: Floats, pitch_rate: Floats, roll_rate: Floats) -> Floats:
    """(n, 3) rotation rate in rad/s, camera axes, of angles as in `rotation` and their rates."""
    level = np.cos(pitch) * yaw_rate
    return np.stack(
        [
            np.cos(roll) * pitch_rate + np.sin(roll) * level,
            -np.sin(roll) * pitch_rate + np.cos(roll) * level,
            roll_rate - np.sin(pitch) * yaw_rate,
        ],
        axis=1,
    )


class Trajectory:
    """The motion of a drive; times are arrays (n,) in s."""

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self._grid = np.arange(-1.0, drive.seconds + 2.0, 1e-3)
        velocity = drive.speed.at(self._grid)[:, None] * self.forward(self._grid)
        steps = (velocity[1:] + velocity[:-1]) / 2 * np.diff(self._grid)[:, None]
        path = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        self._path = path - path[np.searchsorted(self._grid, 0.0)]

    def heading(self, time_s: Floats) -> Floats:
        """(n,) rad, left positive."""
        integral = self._drive.yaw_rate.integral(np.append(time_s, 0.0))
        turned: Floats = integral[:-1] - integral[-1]
        return turned

    def forward(self, time_s: Floats) -> Floats:
        """(n, 2) unit vector of the heading, (x, z)."""
        heading = self.heading(time_s)
        return np.stack([-np.sin(heading), np.cos(heading)], axis=1)

    def ground_position(self, time_s: Floats) -> Floats:
        """(n, 2) x, z in m, of the axle."""
        return np.stack([np.interp(time_s, self._grid, column) for column in self._path.T], axis=1)

    def position(self, time_s: Floats) -> Floats:
        """(n, 3) of the camera in m."""
        x, z = (self.ground_position(time_s) + self._drive.camera_ahead_m * self.forward(time_s)).T
        return np.stack([x, -self._drive.camera_height_m - self._shake("heave", time_s, 0), z], axis=1)

    def attitude(self, time_s: Floats) -> Floats:
        """(n, 3, 3) camera to world."""
        return rotation(*self._angles(time_s))

    def gyro(self, time_s: Floats) -> Floats:
        """(n, 3) rotation rate in rad/s, camera axes."""
        _, pitch, roll = self._angles(time_s)
        yaw_rate = self._shake("yaw", time_s, 1) - self._drive.yaw_rate.at(time_s)
        pitch_rate, roll_rate = self._shake("pitch", time_s, 1), self._shake("roll", time_s, 1)
        return body_rates(pitch, roll, yaw_rate, pitch_rate, roll_rate)

    def specific_force(self, time_s: Floats) -> Floats:
        """(n, 3) in m/s², camera axes: at rest (0, -9.81, 0)."""
        ahead = self.forward(time_s)
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        centripetal = self._drive.speed.at(time_s) * self._drive.yaw_rate.at(time_s)
        x, z = (self._drive.speed.slope(time_s)[:, None] * ahead + centripetal[:, None] * left).T
        force = np.stack([x, -self._shake("heave", time_s, 2) - GRAVITY_MPS2, z], axis=1)
        turned: Floats = np.einsum("nji,nj->ni", self.attitude(time_s), force)
        return turned

    def _angles(self, time_s: Floats) -> tuple[Floats, Floats, Floats]:
        return (
            self._shake("yaw", time_s, 0) - self.heading(time_s),
            self._shake("pitch", time_s, 0) + self._drive.camera_pitch_rad,
            self._shake("roll", time_s, 0),
        )

    def _shake(self, axis: Axis, time_s: Floats, derivative: int) -> Floats:
        """The vibration of one axis or a time derivative of it; yaw about y, so right positive."""
        total = np.zeros_like(time_s)
        for shake in self._drive.shakes:
            if shake.axis == axis:
                omega = 2 * np.pi * shake.frequency_hz
                phase = omega * time_s + shake.phase_rad + derivative * np.pi / 2
                total += shake.amplitude * omega**derivative * np.sin(phase)
        return total
