"""The speed limit that expected contacts impose: ``geometry_msgs/msg/TwistStamped``, and Nav2's own message."""

import math

import numpy as np

from lcf_edge.cdr import Writer
from lcf_edge.messages import Scene
from lcf_edge.standard_messages.labels import PROBABLY
from lcf_edge.standard_messages.positions import Setup

MESSAGE = "geometry_msgs/msg/TwistStamped"
NAV2_MESSAGE = "nav2_msgs/msg/SpeedLimit"

NAV2_STOP_MPS = 1e-3
"""m/s: sent to Nav2 instead of 0, which would mean no limit."""

_EARLY_SIGMAS = 2.0


def speed_limit_mps(scene: Scene, horizon_s: float) -> float:
    """Return the present speed, reduced so that the first contact comes after ``horizon_s``; infinite: no contact.

    Contacts are taken two sigmas early. 0 where the time to contact or the vehicle's own speed is not known.
    """
    met = scene.objects[scene.objects["probability"] >= PROBABLY]
    early_s = met["ttc"] - _EARLY_SIGMAS * np.nan_to_num(met["ttc_sigma"])
    first_s = float(np.where(np.isnan(early_s), 0.0, early_s).min(initial=math.inf))
    if first_s >= horizon_s:
        return math.inf
    speed_mps = float(scene.vehicle_speed)
    return max(first_s, 0.0) / horizon_s * abs(speed_mps) if math.isfinite(speed_mps) else 0.0


def encode_speed_limit(scene: Scene, setup: Setup) -> bytes:
    """The limit in ``twist.linear.x``, m/s; infinite: none. Raises ``CdrError``."""
    writer = Writer()
    writer.header(scene.stamp_ns, setup.base_frame)
    writer.scalars("6d", speed_limit_mps(scene, setup.horizon_s), 0, 0, 0, 0, 0)
    return writer.payload()


def encode_nav2_speed_limit(scene: Scene, setup: Setup) -> bytes:
    """For Nav2's controller server, which takes 0 for no limit. Raises ``CdrError``."""
    limit_mps = speed_limit_mps(scene, setup.horizon_s)
    writer = Writer()
    writer.header(scene.stamp_ns, setup.base_frame)
    writer.scalars("?", False)  # m/s, not percent
    writer.scalars("d", max(limit_mps, NAV2_STOP_MPS) if math.isfinite(limit_mps) else 0.0)
    return writer.payload()
