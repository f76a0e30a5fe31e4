"""The definition of the scene, with its nested types, as ``ros2msg`` (the notation of MCAP and rosbag2)."""

from pathlib import Path

MESSAGES = Path(__file__).parents[1] / "msg"
SCHEMA_ENCODING = "text/plain;ros2msg"

_STANDARD = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
}


def scene_schema() -> str:
    """Return ``Scene.msg``, followed by each message that it names."""
    ours = {f"lcf_msgs/{name}": _definition(name) for name in ("Circle", "PsiRegion", "Object")}
    parts = [_definition("Scene")]
    parts += [f"MSG: {name}\n{text}" for name, text in {**ours, **_STANDARD}.items()]
    return ("=" * 80 + "\n").join(parts)


def _definition(name: str) -> str:
    return (MESSAGES / f"{name}.msg").read_text(encoding="utf-8")
