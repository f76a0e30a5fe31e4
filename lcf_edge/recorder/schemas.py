"""The definitions of the recorded messages, each with all that it is made of, as ``ros2msg``."""

import re

from lcf_edge.zenoh_link.schema import scene_schema

ENCODING = "ros2msg"

_DEFINITIONS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
    "geometry_msgs/TwistStamped": "std_msgs/Header header\ngeometry_msgs/Twist twist\n",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data\n",
    "sensor_msgs/Imu": (
        "std_msgs/Header header\n"
        "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    ),
    "sensor_msgs/RegionOfInterest": (
        "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
    ),
    "sensor_msgs/CameraInfo": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\n"
        "float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\n"
        "uint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n"
    ),
    "diagnostic_msgs/KeyValue": "string key\nstring value\n",
    "diagnostic_msgs/DiagnosticStatus": (
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n"
        "byte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n"
    ),
    "diagnostic_msgs/DiagnosticArray": "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
}


def schema(message: str) -> bytes:
    """The definition of a type (``sensor_msgs/msg/Imu``), and behind it those of the types that it names."""
    if message == "lcf_msgs/msg/Scene":
        return scene_schema().encode()
    first, *others = _with_parts(message.replace("/msg/", "/"))
    parts = [_DEFINITIONS[first], *(f"MSG: {name}\n{_DEFINITIONS[name]}" for name in others)]
    return ("=" * 80 + "\n").join(parts).encode()


def _with_parts(name: str) -> list[str]:
    """A type and all that it is made of, each once."""
    names = [name]
    for one in names:
        parts = re.findall(r"^(\w+/\w+)", _DEFINITIONS[one], re.MULTILINE)
        names += [part for part in dict.fromkeys(parts) if part not in names]
    return names
