"""``tf2_msgs/msg/TFMessage``: the camera's pose on the vehicle, for ``/tf_static``."""

from lcf_edge.cdr import Writer
from lcf_edge.standard_messages.positions import Setup, quaternion

MESSAGE = "tf2_msgs/msg/TFMessage"


def encode_camera_transform(stamp_ns: int, setup: Setup) -> bytes:
    """Encode the transform from ``base_frame`` to the camera's optical frame. Raises ``CdrError``."""
    writer = Writer()
    writer.scalars("I", 1)
    writer.header(stamp_ns, setup.base_frame)
    writer.string(setup.frame_id)
    writer.scalars("7d", setup.ahead_m, setup.left_m, setup.up_m, *quaternion(setup.base_from_optical))
    return writer.payload()
