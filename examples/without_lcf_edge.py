"""A subscriber that needs only NumPy and eclipse-zenoh: the NumPy type is the wire layout.

python examples/without_lcf_edge.py
"""

import struct

import numpy as np
import zenoh

CIRCLE = np.dtype(
    [("id", "<u4"), ("kind", "u1"), ("cause", "u1"), ("support", "<u2")]
    + [(name, "<f4") for name in ("x", "y", "radius", "direction", "speed", "trust")]
    + [(name, "<f4") for name in ("ttc", "bearing", "elevation", "range", "lateral")]
)
PSI_REGION = np.dtype(
    [("id", "<u4"), ("shape", "u1"), ("padding", "V3")]
    + [(name, "<f4") for name in ("x", "y", "width", "height", "trust")]
)
WITH_SIGMA = ("ttc", "bearing", "elevation", "range", "lateral", "v_forward", "v_right", "closest")
OBJECT = np.dtype(
    [("id", "<u4"), ("class_id", "u1"), ("state", "u1"), ("support", "<u2")]
    + [(name, "<f4") for name in ("x", "y", "width", "height")]
    + [(name + sigma, "<f4") for name in WITH_SIGMA for sigma in ("", "_sigma")]
    + [(name, "<f4") for name in ("probability", "trust", "age", "unseen")]
)


def decode(payload):
    """Return stamp (ns), number, size (px), speed (m/s), circles, ψ regions and objects of a scene."""
    body = payload[4:]  # after the encapsulation
    sec, nanosec, name_length = struct.unpack_from("<iII", body)
    at = 12 + name_length
    at += -at % 8  # frame_seq is aligned to 8 bytes
    seq, width, height, speed = struct.unpack_from("<QIIf", body, at)
    at += 20
    (count,) = struct.unpack_from("<I", body, at)
    circles = np.frombuffer(body, CIRCLE, count, at + 4)
    at += 4 + circles.nbytes
    (count,) = struct.unpack_from("<I", body, at)
    psi = np.frombuffer(body, PSI_REGION, count, at + 4)
    at += 4 + psi.nbytes
    objects = np.empty(0, OBJECT)
    if at < len(body):
        (count,) = struct.unpack_from("<I", body, at)
        objects = np.frombuffer(body, OBJECT, count, at + 4)
    return sec * 1_000_000_000 + nanosec, seq, (width, height), speed, circles, psi, objects


if __name__ == "__main__":
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')
    with zenoh.open(config) as session:
        subscriber = session.declare_subscriber("lcf/scene")  # keep it: it ends with its name
        for sample in subscriber:
            stamp_ns, seq, size, speed, circles, psi, objects = decode(sample.payload.to_bytes())
            print(seq, objects[["class_id", "bearing", "ttc", "ttc_sigma"]])
