"""Configuration: typed tables with the unit in each name, from TOML and ``--set``.

``load`` reads a file (or the defaults), applies ``KEY=VALUE`` settings, and returns one ``Config``,
checked as a whole: an unknown key, a wrong type or an impossible value is a ``ConfigError`` that names the key.
"""

import math
from collections.abc import Iterator, Sequence
from difflib import SequenceMatcher
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import msgspec

from drivers.imu.registry import DRIVERS
from lcf_edge.config import bounded_toml
from lcf_edge.config.endpoint import fault
from lcf_edge.config.refusal import why
from lcf_edge.errors import ConfigError
from lcf_edge.image_limit import MAX_PIXELS
from lcf_edge.printable import printable

DEFAULT_PATH = Path("/etc/lcf-edge/config.toml")
MIN_HEIGHT_M = 0.001
MAX_POLYGONS, MAX_POINTS = 64, 256  # of a mask

_MEASURED = ("delta_rebel_px", "edge_noise_px", "focus_sigma_px")  # once keys of `filter`, now measured
_SHOWN = 60  # characters of an unknown key
_MAX_QUOTED = 300  # characters of any other text from the user

# Every number has bounds far beyond what is sensible, within which nothing overflows, divides by zero or takes
# unexpected memory.
Metres = Annotated[float, msgspec.Meta(ge=0.001, le=10_000)]
Pixels = Annotated[float, msgspec.Meta(ge=0.001, le=10_000)]
Gate = Annotated[float, msgspec.Meta(ge=0.001, le=60)]  # px; the number of pairs within it grows with its square
Seconds = Annotated[float, msgspec.Meta(ge=0.001, le=3600)]
Radians = Annotated[float, msgspec.Meta(ge=0.001, le=3.15)]
Ratio = Annotated[float, msgspec.Meta(ge=0.001, le=1_000_000)]
Trust = Annotated[float, msgspec.Meta(ge=0, le=1000)]
Share = Annotated[float, msgspec.Meta(ge=0.001, le=1)]
Mebibytes = Annotated[float, msgspec.Meta(ge=0.001, le=1e9)]
Count = Annotated[int, msgspec.Meta(ge=1, le=32767)]  # 16 bits number the rows
Side = Annotated[int, msgspec.Meta(ge=1, le=16384)]
Offset = Annotated[float, msgspec.Meta(ge=-1000, le=1000)]  # m
Tilt = Annotated[float, msgspec.Meta(gt=-1.5, lt=1.5)]


if TYPE_CHECKING:
    ImuDriver: TypeAlias = str
else:
    ImuDriver = Literal[("none", *DRIVERS, "recording")]


# fmt: off
PixelFormat = Literal[
    "auto", "GREY", "NV12", "NV21", "NV16", "NV61", "YU12", "YV12", "422P", "NM12", "NM21", "NM16", "NM61", "YM12",
    "YM21", "Y10P", "Y12P", "Y10", "Y12", "Y16", "YUYV", "YVYU", "UYVY", "VYUY", "XR24", "XB24", "BGR3", "RGB3",
    "MJPG", "BA81", "BG10", "BG12", "pBAA", "pBCC", "BYR2", "GBRG", "GB10", "GB12", "pGAA", "pGCC", "GB16", "GRBG",
    "BA10", "BA12", "pgAA", "pgCC", "GR16", "RGGB", "RG10", "RG12", "pRAA", "pRCC", "RG16",
]
# fmt: on


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of the file; unknown keys are refused."""


class Camera(Table, frozen=True):
    """What the camera is and where it sits."""

    driver: Literal["auto", "v4l2", "libcamera", "recording"] = "auto"
    device: str = "/dev/video0"  # path, /dev/v4l/by-id/..., the name that the camera gives itself, or its sensor's
    recording: str = ""  # what driver = "recording" replays
    width: Side = 640
    height: Side = 480
    fps: Annotated[float, msgspec.Meta(ge=0.001, le=10_000)] = 20.0  # requested; also the rate of images without stamps
    format: PixelFormat = "auto"
    exposure_s: Annotated[float, msgspec.Meta(ge=1e-6, le=100)] | None = None  # not given: the camera's own automatic
    gain: Annotated[int, msgspec.Meta(ge=-(2**31), le=2**31 - 1)] | None = (
        None  # in the camera's own units; not given: the camera's own automatic
    )
    power_line_hz: Literal[0, 50, 60] | None = None  # against flicker; 0: off
    intrinsics: list[
        Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]
    ] = []  # fx, fy, cx, cy in px; empty: the recording's, else by the field of view
    horizontal_fov_rad: Annotated[float, msgspec.Meta(gt=0.1, lt=3.1)] = 1.05  # used where nothing else is known
    distortion_model: Literal["none", "radial-tangential", "equidistant"] = "none"
    distortion: list[Annotated[float, msgspec.Meta(ge=-100, le=100)]] = []  # k1, k2, p1, p2[, k3] or k1, k2, k3, k4
    height_m: Annotated[float, msgspec.Meta(ge=0, le=10_000)] = 0.3  # above the ground; 0: unknown, no ground test
    pitch_rad: Tilt = 0.0  # positive: looks up
    yaw_rad: Tilt = 0.0  # positive: looks to the right of the direction of travel
    ahead_m: Offset = 0.0  # of the vehicle's base frame, at the axle that does not steer; in turns it is learnt
    left_m: Offset = 0.0  # of the base frame; for publish.transform alone
    mask: list[
        list[list[Annotated[float, msgspec.Meta(ge=-20_000, le=40_000)]]]
    ] = []  # own parts in view: polygons of x, y in px of an image of width x height


class Imu(Table, frozen=True):
    """Which IMU there is, and how its samples are turned into the camera's axes."""

    driver: ImuDriver = "none"
    bus: Annotated[int, msgspec.Meta(ge=0, le=255)] = 1  # /dev/i2c-N
    address: Annotated[int, msgspec.Meta(ge=0, le=0x77)] = 0  # 0: the chip's usual one
    identity: Annotated[int, msgspec.Meta(ge=0, le=255)] | None = (
        None  # of a copy of the chip, as named by the error that refuses it
    )
    port: str = "/dev/ttyUSB0"  # path or /dev/serial/by-id/...
    baud: Annotated[int, msgspec.Meta(ge=0, le=4_000_000)] = 0  # 0: the protocol's usual one
    device: str = ""  # of driver = "iio": the chip's name or iio:deviceN; empty: the first with a gyro
    firmware: str = "/lib/firmware/bmi270-init-data.fw"  # what is loaded into a bmi270 at every start
    recording: str = ""  # what driver = "recording" replays
    rate_hz: Annotated[float, msgspec.Meta(ge=10, le=1000)] = 200.0
    gyro_range_dps: Literal[250, 500, 1000, 2000] = 500
    accel_range_g: Literal[2, 4, 8, 16, 32] = 4
    axes: list[
        list[Annotated[float, msgspec.Meta(ge=-2, le=2)]]
    ] = []  # 3x3 rotation into the camera frame; empty: the recording's, else identity
    time_offset_s: Annotated[float, msgspec.Meta(ge=-4e9, le=4e9)] = 0.0  # camera time = IMU time + offset
    gyro_noise_radps: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.005  # 1 sigma of what is left after the bias


class Vehicle(Table, frozen=True):
    """Size and speed of the vehicle."""

    half_width_m: Metres = 0.3
    height_m: Metres = 2.0  # what passes above this is no threat
    horizon_s: Seconds = 4.0  # contact later than this is no threat yet
    speed_source: Literal["auto", "odometry", "zenoh", "imu", "constant", "none"] = "auto"
    speed_mps: Annotated[float, msgspec.Meta(ge=-70, le=70)] | None = None  # the constant


class Filter(Table, frozen=True):
    """Constants of the filter, by the paper's names; the profile sets those that are not given."""

    profile: Literal["rover", "paper"] = "rover"
    fast_threshold: Annotated[int, msgspec.Meta(ge=1, le=254)] = 25
    fast_adaptive: bool = True  # the threshold follows the scene so that about `corners_target` are found
    corners_target: Count = 700
    least_roundness: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.02  # λ_min/λ_max; below: along an edge
    tr_cr: Trust = 2.0
    tr_s: Trust = 3.0
    tr_max: Trust = 5.0
    delta_px: Gate = 1.5  # δ, corner noise off the flow line
    bl0_px: Gate = 12.0  # BL at birth
    leap_px: Annotated[float, msgspec.Meta(ge=0.001, le=200)] = (
        40.0  # farthest that a landmark may move between its first two frames
    )
    bl_min_px: Gate = 3.0
    bs_px: Pixels = 64.0  # BS_λ, largest radius of a circle
    scene_depth_m: Metres = 4.0  # depth of a new landmark outside all circles
    appearance_max: Annotated[float, msgspec.Meta(ge=0.001, le=255)] = (
        28.0  # largest mean absolute grey difference of the same corner
    )
    appearance_share: Annotated[float, msgspec.Meta(ge=0.001, le=100)] = (
        0.25  # and as a share of the corner's own contrast
    )
    key_interval_s: Seconds = 0.05  # least time between key frames of α
    key_motion_px: Annotated[float, msgspec.Meta(ge=0, le=1000)] = (
        1.0  # a key frame waits for this median motion, two intervals at most
    )
    eps_beta_rad: Radians = 0.349  # ε_β, 20°
    eps_v: Ratio = 10.0  # ε_V
    eps_beta_rebel_rad: Radians = 0.873  # 50°
    eps_v_rebel: Ratio = 40.0
    eps_beta_circle_rebel_rad: Radians = 0.175  # 10°
    eps_v_circle_rebel: Ratio = 1000.0
    involvement: Share = 0.5
    circle_support: Count = 4  # edges that make a normal circle
    rebel_support: Count = 3  # edges that make a rebel circle
    rebel_share: Share = 0.15  # of the edges in a rebel circle must be rebels
    rebel_link_px: Pixels = 40.0  # rebels farther apart are not of one circle
    corner_noise_px: Gate = 0.29  # 1 sigma of a corner's position, at least: that of whole pixels, 1/√12
    ground_margin: Share = 0.2  # share by which the ground may be misjudged
    pitch_sigma_rad: Annotated[float, msgspec.Meta(ge=0, le=1.5)] = 0.008
    patches: Annotated[int, msgspec.Meta(ge=0, le=64)] = 6  # of the image near the path, followed for seconds
    psi_life_s: Seconds = 0.3  # ψ expires and the region is looked at again


PAPER = Filter(
    profile="paper",
    fast_adaptive=False,
    least_roundness=0.0,
    delta_px=4.0,
    bl0_px=25.0,
    key_interval_s=1.0,
    key_motion_px=0.0,
    patches=0,
    psi_life_s=3.0,
)
"""The paper's constants: 640x480, FAST-9 threshold 25, one frame a second."""

ROVER = Filter()
"""The shipped default, for 15 to 60 frames a second."""


class Memory(Table, frozen=True):
    """Capacities of the tables; nothing grows beyond them."""

    budget_mib: Mebibytes = 96.0
    corners: Count = 1500
    edges_normal: Count = 1500
    edges_rebel: Count = 300
    chains: Count = 300
    circles_normal: Count = 96
    circles_rebel: Count = 32
    groups: Count = 128
    psi: Count = 32
    objects: Count = 24


class Zenoh(Table, frozen=True):
    """How the Zenoh session is opened. By default: loopback only, no scouting."""

    mode: Literal["peer", "client", "router"] = "peer"
    connect: list[str] = []
    listen: list[str] = msgspec.field(default_factory=lambda: ["tcp/127.0.0.1:7447"])
    gate: bool = True  # a process before plain TCP ports on loopback, which keeps out what would end the daemon
    gossip: bool = False  # connect to the peers of peers, as rmw_zenoh does
    config_file: str = ""  # Zenoh's own (JSON5), for TLS and access control; the keys above override it


class Publish(Table, frozen=True):
    """What is published, and under which names."""

    prefix: str = "lcf"
    frame_id: str = "camera"
    robot: str = "rover"
    preview_hz: Annotated[float, msgspec.Meta(ge=0, le=100)] = 5.0  # at most, while somebody subscribes; 0: none
    annotations: bool = False  # for Foxglove: what is drawn over the image
    points: bool = False  # PointCloud2 of what will be met: for Nav2
    markers: bool = False  # MarkerArray of the objects: for RViz
    detections: bool = False  # Detection2DArray and Detection3DArray
    speed_limit: bool = False  # TwistStamped, and Nav2's SpeedLimit
    transform: bool = False  # where the camera sits: /tf_static
    base_frame: str = "base_link"  # of the vehicle, on the ground
    ros2: bool = False  # also publish the samples under the names of rmw_zenoh
    ros2_domain: Annotated[int, msgspec.Meta(ge=0, le=232)] = 0  # ROS_DOMAIN_ID
    ros2_type_hash: Literal["RIHS01", "TypeHashNotSupported"] = "RIHS01"  # the other one: Humble


class Record(Table, frozen=True):
    """What the daemon writes into recordings, and how much of the disk they may take."""

    when: Literal["never", "always", "threat"] = "never"
    folder: str = "/var/lib/lcf-edge"
    format: Literal["jpeg", "png"] = "jpeg"  # png: without loss, some five times as large
    jpeg_quality: Annotated[int, msgspec.Meta(ge=1, le=100)] = 80
    ttc_s: Seconds = 1.5  # contacts sooner than this are threats
    before_s: Annotated[float, msgspec.Meta(ge=0, le=3600)] = 2.0  # saved from before a threat
    after_s: Annotated[float, msgspec.Meta(ge=0, le=3600)] = 5.0
    buffer_mib: Annotated[float, msgspec.Meta(ge=1, le=4095)] = (
        2.0  # of memory: what waits for the disk, or for a threat
    )
    file_mib: Annotated[float, msgspec.Meta(ge=1, le=4095)] = 512.0  # size at which the next file begins
    file_s: Annotated[float, msgspec.Meta(gt=0, le=1800)] = 900.0  # and its age: its index is in memory
    total_mib: Mebibytes = 4096.0  # of all files in the folder; the oldest are removed
    free_mib: Annotated[float, msgspec.Meta(ge=0, le=1e9)] = 512.0  # left free on the disk


class Metrics(Table, frozen=True):
    """The diagnostics as Prometheus text, once a second."""

    textfile: str = ""  # for node_exporter's textfile collector; empty: none
    port: Annotated[int, msgspec.Meta(ge=0, le=65535)] = 0  # on 127.0.0.1; 0: none


class Log(Table, frozen=True):
    """What the daemon writes to standard error."""

    level: Literal["error", "warning", "info", "debug"] = "info"


class Config(Table, frozen=True):
    """The whole configuration."""

    camera: Camera = Camera()
    imu: Imu = Imu()
    vehicle: Vehicle = Vehicle()
    filter: Filter = Filter()
    memory: Memory = Memory()
    zenoh: Zenoh = Zenoh()
    publish: Publish = Publish()
    record: Record = Record()
    metrics: Metrics = Metrics()
    log: Log = Log()


def load(path: Path | None = None, settings: Sequence[str] = (), *, filled: bool = False) -> Config:
    """Read a configuration.

    ``path``: a TOML file, or a recording of ``lcf-edge record``; None: ``DEFAULT_PATH`` when it exists, else the
    defaults. ``settings``: ``KEY=VALUE`` with dotted keys and TOML values (a bare word is a string). ``filled``: a
    missing or empty file is refused. Raises ``ConfigError``.
    """
    file = _read(path or DEFAULT_PATH, needed=filled or path is not None, filled=filled)
    _typed(file, str(path or DEFAULT_PATH))
    over: dict[str, Any] = {}
    for setting in settings:
        _apply(over, setting)
    _typed(over, "--set")
    config = _typed({name: file.get(name, {}) | over.get(name, {}) for name in file | over}, "configuration")
    _check(config, " with ".join([str(path or DEFAULT_PATH)] * bool(file) + ["--set"] * bool(over)))
    return config


def is_filled(path: Path) -> bool:
    """Whether the file exists and holds more than white space."""
    try:
        return bool(_start_of(path).strip())
    except OSError:
        return False


def _read(path: Path, *, needed: bool, filled: bool) -> dict[str, Any]:
    try:
        data = _attached(path) if path.suffix.lower() == ".mcap" else _start_of(path)
    except OSError as error:
        if isinstance(error, FileNotFoundError) and not needed:
            return {}
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); name another file with -c") from error
    if filled and not data.strip():
        raise ConfigError(f"{path}: empty; for the defaults, write a comment into it")
    if len(data) > bounded_toml.MAX_BYTES:
        raise ConfigError(f"{path}: too large for a configuration file; name another file with -c")
    try:
        tree = bounded_toml.parse(data.decode())
    except ValueError as error:
        raise ConfigError(f"{path}: not valid TOML: {printable(str(error), _MAX_QUOTED)}") from error
    return _without_measured(tree) if path.suffix.lower() == ".mcap" else tree


def _without_measured(tree: dict[str, Any]) -> dict[str, Any]:
    """What an earlier version recorded, which nobody can edit, without the keys that are gone since."""
    section = tree.get("filter")
    if not isinstance(section, dict):
        return tree
    return {**tree, "filter": {name: value for name, value in section.items() if name not in _MEASURED}}


def _start_of(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(bounded_toml.MAX_BYTES + 1)


def _attached(path: Path) -> bytes:
    from lcf_edge.config.attached import attached_configuration  # noqa: PLC0415  # only needed for recordings

    return attached_configuration(path)


def _apply(tree: dict[str, Any], setting: str) -> None:
    key, equals, text = setting.partition("=")
    if not equals or not key.strip():
        raise ConfigError(f"--set {setting}: write KEY=VALUE, for example --set vehicle.half_width_m=0.6")
    if not setting.isprintable():
        raise ConfigError(f"--set {setting!a}: characters that cannot be printed; leave them out")
    try:
        value = bounded_toml.parse(f"value = {text}")["value"]
    except ValueError:
        value = text.strip()
    *tables, name = key.strip().split(".", bounded_toml.DEEPEST)
    for table in tables:
        tree = tree.setdefault(table, {})
        if not isinstance(tree, dict):
            raise ConfigError(f"--set {setting}: {table} is a value, not a table")
    tree[name] = value


def _typed(tree: dict[str, Any], origin: str) -> Config:
    """Fill in defaults; refuse unknown keys and wrong types."""
    _refuse_unknown(tree, Config, "", origin)
    section = tree.get("filter")
    if isinstance(section, dict) and section.get("profile") == "paper":
        tree = {**tree, "filter": {**msgspec.structs.asdict(PAPER), **section}}
    try:
        return msgspec.convert(tree, Config)
    except msgspec.ValidationError as error:
        key = str(error).partition(" - at ")[2].strip("`").removeprefix("$.")
        raise ConfigError(f"{origin}: {key}: {why(tree, key, Config)}") from error


def _refuse_unknown(tree: dict[str, Any], table: type[msgspec.Struct], prefix: str, origin: str) -> None:
    known = {field.name: field.type for field in msgspec.structs.fields(table)}
    for name, value in tree.items():
        if prefix == "filter." and name in _MEASURED:
            raise ConfigError(f"{origin}: filter.{name} is gone, since it is measured now; delete it")
        if name not in known:
            shown = printable(name, _SHOWN)
            raise ConfigError(f"{origin}: unknown key {prefix}{shown}{_hint(shown, prefix)}")
        if isinstance(value, dict) and isinstance(known[name], type) and issubclass(known[name], Table):
            _refuse_unknown(value, known[name], f"{name}.", origin)


def _hint(name: str, prefix: str) -> str:
    """Return the closest valid key, also of another table."""
    keys = [(field.name, "") for field in msgspec.structs.fields(Config)]
    keys += [
        (field.name, f"{table.name}.")
        for table in msgspec.structs.fields(Config)
        for field in msgspec.structs.fields(table.type)
    ]

    def closeness(key: tuple[str, str]) -> float:
        same_table = 0.2  # a wrong table is rarer than a wrong letter
        return SequenceMatcher(None, name, key[0]).ratio() + same_table * (key[1] == prefix)

    closest = max(keys, key=closeness)
    return f"; did you mean {closest[1]}{closest[0]}?" if closeness(closest) > 0.7 else ""


def _check(config: Config, origin: str) -> None:
    """Refuse what types alone cannot exclude."""
    camera, filters = config.camera, config.filter
    for table, values in msgspec.to_builtins(config).items():
        for key, value in values.items():
            if not all(map(math.isfinite, _numbers(value))):
                raise ConfigError(f"{origin}: {table}.{key}: must be finite, not {value}")
    for table, driver, recording in (
        ("camera", camera.driver, camera.recording),
        ("imu", config.imu.driver, config.imu.recording or camera.recording),
    ):
        if driver == "recording" and not recording:
            raise ConfigError(f"{origin}: {table}.recording: needed with {table}.driver=recording; name a recording")
    if camera.width * camera.height > MAX_PIXELS:
        raise ConfigError(f"{origin}: camera.width: more than {MAX_PIXELS} pixels; lower camera.width or camera.height")
    if 0 < camera.height_m < MIN_HEIGHT_M:
        raise ConfigError(f"{origin}: camera.height_m: 0 (unknown), or {MIN_HEIGHT_M} at least")
    _check_lens(camera, origin)
    check_mask(camera, origin)
    _check_endpoints(config.zenoh, origin)
    axes = config.imu.axes
    if axes and (len(axes) != 3 or any(len(row) != 3 for row in axes)):
        raise ConfigError(f"{origin}: imu.axes: needs three rows of three numbers")
    if axes and not _is_rotation(axes):
        raise ConfigError(f"{origin}: imu.axes: not a rotation (rows must be orthonormal, determinant +1)")
    if config.vehicle.speed_source == "constant" and config.vehicle.speed_mps is None:
        raise ConfigError(f"{origin}: vehicle.speed_mps: needed with vehicle.speed_source=constant")
    if config.record.total_mib < config.record.file_mib:
        raise ConfigError(f"{origin}: record.total_mib: must be record.file_mib at least")
    if not filters.tr_cr <= filters.tr_s <= filters.tr_max:
        raise ConfigError(f"{origin}: filter.tr_s: trusts must be ordered tr_cr <= tr_s <= tr_max")


def _check_lens(camera: Camera, origin: str) -> None:
    if camera.intrinsics and len(camera.intrinsics) != 4:
        raise ConfigError(f"{origin}: camera.intrinsics: needs four numbers fx, fy, cx, cy in px")
    if camera.intrinsics and min(camera.intrinsics[:2]) <= 0:
        raise ConfigError(f"{origin}: camera.intrinsics: focal lengths must be positive")
    numbers = {"none": (0,), "radial-tangential": (4, 5), "equidistant": (4,)}[camera.distortion_model]
    if len(camera.distortion) not in numbers:
        counts = " or ".join(map(str, numbers))
        raise ConfigError(f"{origin}: camera.distortion: {camera.distortion_model} takes {counts} numbers")


def check_mask(camera: Camera, origin: str) -> None:
    """Raise ``ConfigError`` in the name of ``origin`` if ``camera.mask`` cannot be used."""
    if len(camera.mask) > MAX_POLYGONS:
        raise ConfigError(f"{origin}: camera.mask: {len(camera.mask)} polygons, more than {MAX_POLYGONS}")
    for number, polygon in enumerate(camera.mask, start=1):
        if not 3 <= len(polygon) <= MAX_POINTS or any(len(point) != 2 for point in polygon):
            raise ConfigError(
                f"{origin}: camera.mask: polygon {number} must have 3 to {MAX_POINTS} points [x, y]; "
                "lcf-edge calibrate mask makes them"
            )
        if not all(
            -camera.width <= x <= 2 * camera.width and -camera.height <= y <= 2 * camera.height for x, y in polygon
        ):
            size = f"{camera.width}x{camera.height}"
            raise ConfigError(f"{origin}: camera.mask: polygon {number} lies far outside an image of {size} px")


def _check_endpoints(zenoh: Zenoh, origin: str) -> None:
    for key, endpoints in (("connect", zenoh.connect), ("listen", zenoh.listen)):
        for wrong in filter(None, map(fault, endpoints)):
            raise ConfigError(f"{origin}: zenoh.{key}: {printable(wrong, _MAX_QUOTED)}")


def _numbers(value: Any) -> Iterator[float]:
    """Yield the numbers in a value, also in nested lists."""
    if isinstance(value, list):
        for item in value:
            yield from _numbers(item)
    elif isinstance(value, int | float):
        yield value


def _is_rotation(rows: list[list[float]]) -> bool:
    (a, b, c), (d, e, f), (g, h, i) = rows
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    dots = [sum(x * y for x, y in zip(p, q, strict=True)) - (p is q) for p in rows for q in rows]
    return abs(determinant - 1) < 1e-3 and max(map(abs, dots)) < 1e-3


def to_toml(config: Config) -> str:
    """The configuration as TOML that ``load`` reads back to the same ``Config``."""
    lines: list[str] = []
    for table in msgspec.structs.fields(Config):
        lines.append(f"[{table.name}]")
        values = msgspec.structs.asdict(getattr(config, table.name))
        lines += [f"{key} = {_to_toml(value)}" for key, value in values.items() if value is not None]
        lines.append("")
    return "\n".join(lines)


def _to_toml(value: Any) -> str:
    """Write a value as JSON, which is TOML for all that a key can hold; control characters are escaped."""
    text = msgspec.json.encode(value).decode()
    return "".join(letter if letter.isprintable() else _escaped(letter) for letter in text)


def _escaped(letter: str) -> str:
    return f"\\u{ord(letter):04x}" if ord(letter) < 2**16 else f"\\U{ord(letter):08x}"
