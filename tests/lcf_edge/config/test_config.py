"""Configuration: what is accepted, what is refused and how, and that it survives being written down."""

import math
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import inspect

from lcf_edge.cli.command_line import main
from lcf_edge.config import (
    PAPER,
    ROVER,
    Camera,
    Config,
    Filter,
    Imu,
    Memory,
    Table,
    Vehicle,
    Zenoh,
    bounded_toml,
    load,
    to_toml,
)
from lcf_edge.config import config as module
from lcf_edge.errors import ConfigError

Refused = Callable[..., str]

TABLES: dict[str, type[Table]] = {table.name: table.type for table in msgspec.structs.fields(Config)}
FLAT = "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]"


@pytest.fixture(autouse=True)
def default_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the file of the whole machine would be."""
    path = tmp_path / "etc" / "config.toml"
    monkeypatch.setattr(module, "DEFAULT_PATH", path)
    return path


@pytest.fixture
def file(tmp_path: Path) -> Callable[[str | bytes], Path]:
    def write(content: str | bytes) -> Path:
        path = tmp_path / "config.toml"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def refused(path: Path | None, *assignments: str) -> str:
    """The one line with which a configuration is refused."""
    with pytest.raises(ConfigError) as error:
        load(path, assignments)
    text = str(error.value)
    assert "\n" not in text
    assert error.value.exit_status == 2
    return text


# Files and settings


def test_without_a_file_the_defaults_hold() -> None:
    assert load() == Config()


def test_the_file_of_the_machine_is_read_when_there_is_one(default_path: Path) -> None:
    default_path.parent.mkdir()
    default_path.write_text("[vehicle]\nhalf_width_m = 0.6\n")
    assert load().vehicle.half_width_m == 0.6


def test_a_file_of_the_machine_that_cannot_be_read_is_not_passed_over(default_path: Path) -> None:
    default_path.mkdir(parents=True)
    assert refused(None).startswith(f"{default_path}: cannot be read")


def test_settings_go_on_top_of_the_file(file: Callable[[str], Path]) -> None:
    path = file("[vehicle]\nhalf_width_m = 0.6\nhorizon_s = 3\n[camera]\nheight_m = 0.5\n")
    config = load(path, ["vehicle.half_width_m=0.7", "vehicle.half_width_m = 0.8", "imu.gyro_noise_radps=0"])
    assert config.vehicle == Vehicle(half_width_m=0.8, horizon_s=3.0)
    assert config.camera == Camera(height_m=0.5)
    assert config.imu == Imu(gyro_noise_radps=0.0)


@pytest.mark.parametrize(
    ("setting", "table", "key", "value"),
    [
        ("vehicle.half_width_m=0.6", "vehicle", "half_width_m", 0.6),
        ("vehicle.half_width_m=1", "vehicle", "half_width_m", 1.0),
        ("memory.psi=7", "memory", "psi", 7),
        ("filter.fast_adaptive=false", "filter", "fast_adaptive", False),
        (
            "camera.intrinsics=[500, 500.5, 319.5, 239.5]",
            "camera",
            "intrinsics",
            [500.0, 500.5, 319.5, 239.5],
        ),
        ('publish.prefix="lcf=1"', "publish", "prefix", "lcf=1"),
        ("publish.prefix=robot7", "publish", "prefix", "robot7"),
        ("vehicle.speed_source = imu ", "vehicle", "speed_source", "imu"),
        ('zenoh.listen=["tcp/[::1]:7447"]', "zenoh", "listen", ["tcp/[::1]:7447"]),
    ],
)
def test_a_setting_is_a_toml_value_or_a_bare_word(setting: str, table: str, key: str, value: Any) -> None:
    assert getattr(getattr(load(settings=[setting]), table), key) == value


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("vehicle.half_width_m", "write KEY=VALUE"),
        ("=0.6", "write KEY=VALUE"),
        ("vehicle=wide", "vehicle"),
        ("publish.robot=\udcff", "cannot be printed"),
        ("vehicle.half_width_m=0.6\nhorizon_s=2", "cannot be printed"),
    ],
)
def test_a_setting_of_another_form_is_refused(setting: str, message: str) -> None:
    text = refused(None, setting)
    assert text.startswith("--set")
    assert message in text


def test_a_setting_below_a_value_is_refused() -> None:
    assert "vehicle is a value" in refused(None, "vehicle=3", "vehicle.half_width_m=0.6")


# What is no configuration at all


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[vehicle\n", "not valid TOML"),
        ("[vehicle]\nhorizon_s = 2\nhorizon_s = 3\n", "not valid TOML"),
        (b"[publish]\nrobot = '\xff\xfe'\n", "not valid TOML"),
        ("[camera]\nintrinsics = " + "[" * 20_000, "not valid TOML"),
        ("[vehicle]\nhorizon_s = " + "9" * 10_000, "not valid TOML"),
        ("# endless\n" * 200_000, "too large"),
        ("a." * 20_000 + "a = 1\n", "not valid TOML: nested too deeply"),
        ('"a".' * 10_000 + "a = 1\n", "not valid TOML: nested too deeply"),
        ("[" + "a." * 20_000 + "a]\n", "not valid TOML: nested too deeply"),
        ("[camera]\ndevice = {" + "a." * 20_000 + "a = 1}\n", "not valid TOML: nested too deeply"),
        ('odd = [""".""""", "x"]\n' + "a." * 20_000 + "a = 1\n", "not valid TOML: nested too deeply"),
    ],
    ids=[
        "syntax", "twice", "not utf-8", "nested without end", "thousands of digits", "too large",
        "dots", "quoted dots", "dots of a table", "dots within a value", "dots behind odd strings",
    ],
)  # fmt: skip
def test_a_file_that_is_no_toml_is_named(
    file: Callable[[str | bytes], Path], content: str | bytes, message: str
) -> None:
    path = file(content)
    text = refused(path)
    assert text.startswith(f"{path}: ")
    assert message in text


@pytest.mark.parametrize(
    "content",
    [
        "a." * 20_000 + "a = 1",
        "".join(f"key{number} = 1\n" for number in range(5500)),
        "".join(f"[key{number}.a.b]\n" for number in range(4000)),
        "[camera]\nintrinsics = [" + "{}," * 20_000 + "]",
        "[camera]\nintrinsics = {" + ",".join(f"a{number}.b.c.d={{}}" for number in range(3500)) + "}",
    ],
    ids=["dots", "keys", "tables", "list", "inline"],
)
def test_what_a_file_may_hold_takes_little_memory(file: Callable[[str], Path], content: str) -> None:
    path = file(content)
    tracemalloc.start()
    try:
        refused(path)
        assert tracemalloc.get_traced_memory()[1] < 24 * 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("piece", ['"\\', '"""\\', '"\\\\', '\\"""', "'", "'''a", "a\t.", "0x"])
def test_what_is_no_toml_is_refused_at_once(file: Callable[[str], Path], piece: str) -> None:
    """A daemon that is busy with its configuration for 5 s counts as dead."""
    path = file(piece * (bounded_toml.MAX_BYTES // len(piece)))
    begin_s = time.process_time()
    assert "not valid TOML" in refused(path)
    assert time.process_time() - begin_s < 2


def test_dots_and_brackets_in_texts_and_comments_count_for_nothing(file: Callable[[str], Path]) -> None:
    path = file(
        "# a.b.c.d.e.f [[[[[[[\n"
        '[publish]\nrobot = "a.b.c.d.e.f [[[[[[ \\" #"  # and [[[[[[[ a.b.c.d.e.f.g\n'
        "frame_id = 'a.b.c.d.e.f.g [[[[[['\n"
        'prefix = """\na.b.c.d.e.f " [[[[[["""\n'
    )
    assert load(path).publish.frame_id == "a.b.c.d.e.f.g [[[[[["


def test_a_folder_and_a_missing_file_are_named(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere.toml"):
        text = refused(path)
        assert text.startswith(f"{path}: cannot be read (")
        assert text.endswith("name another file with -c")


# Keys


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("vehicle.half_widht_m", "vehicle.half_width_m"),
        ("vehicle.heigth_m", "vehicle.height_m"),
        ("camera.heigth_m", "camera.height_m"),
        ("camera.half_width_m", "vehicle.half_width_m"),
        ("filter.horizon_s", "vehicle.horizon_s"),
        ("camera.pitch_sigma_rad", "filter.pitch_sigma_rad"),
        ("vehicle.corner_target", "filter.corners_target"),
        ("half_width_m", "vehicle.half_width_m"),
        ("vehicel.half_width_m", "vehicle"),
        ("camera.vehicle.half_width_m", "vehicle"),
    ],
)
def test_an_unknown_key_names_the_closest_valid_one(file: Callable[[str], Path], key: str, hint: str) -> None:
    for message in (refused(None, f"{key}=1"), refused(file(f"{key} = 1\n"))):
        assert message.endswith(f"; did you mean {hint}?")
        assert ": unknown key " in message


@pytest.mark.parametrize("key", ["filter.delta_rebel_px", "filter.edge_noise_px", "filter.focus_sigma_px"])
def test_a_key_that_an_earlier_version_had_is_to_be_deleted(file: Callable[[str], Path], key: str) -> None:
    assert refused(None, f"{key}=1").endswith(f": {key} is gone, since it is measured now; delete it")
    assert refused(file(f"{key} = 1\n")).endswith("; delete it")


def test_what_an_earlier_version_recorded_is_read_without_them() -> None:
    walkers = Path(__file__).parents[3] / "samples/walkers.mcap"
    assert b"delta_rebel_px" in walkers.read_bytes()
    assert load(walkers).filter.delta_px == Config().filter.delta_px


def test_nothing_is_suggested_for_what_resembles_nothing() -> None:
    assert refused(None, "vehicle.qqq=1") == "--set: unknown key vehicle.qqq"


def test_an_unknown_key_is_shown_short_and_obeyed_by_no_terminal(file: Callable[[str], Path]) -> None:
    message = refused(file('"\\u001b]0;evil\\u0007\\u009b31m' + "k" * 5000 + '" = 1\n'))
    assert len(message) < 300
    assert message.isprintable()
    message = refused(file("[publish]\nrobot = 7\n[camera]\nformat = '" + "\u009b31m" * 1000 + "'\n"))
    assert len(message) < 600
    assert message.isprintable()


@pytest.mark.parametrize(
    "setting",
    [
        "vehicle.half_width_m=wide",
        "vehicle.half_width_m=true",
        "vehicle.half_width_m=1979-05-27",
        "vehicle.half_width_m=[1]",
        "vehicle.half_width_m.left=1",
        "memory.psi=1.5",
        "filter.fast_adaptive=1",
        "filter.fast_adaptive=True",
        "filter.profile=rocket",
        "camera.intrinsics=500",
        "camera.intrinsics=[a]",
        "publish.prefix=7",
        "zenoh.listen=tcp/127.0.0.1:7447",
    ],
)
def test_a_wrong_type_names_the_key(setting: str) -> None:
    key = ".".join(setting.partition("=")[0].split(".")[:2])
    assert refused(None, setting).startswith(f"--set: {key}")


def test_the_error_names_where_the_wrong_value_stands(file: Callable[[str], Path]) -> None:
    path = file("[vehicle]\nhorizon_s = 'soon'\n")
    assert refused(path, "camera.height_m=0.5").startswith(f"{path}: vehicle.horizon_s: ")
    assert refused(path.parent / "none", "a=1").startswith(f"{path.parent / 'none'}: cannot be read")
    path = file("[vehicle]\nhorizon_s = 3\n")
    assert refused(path, "camera.height_m=high").startswith("--set: camera.height_m: ")
    assert refused(path, "vehicle.speed_source=constant").startswith(f"{path} with --set: vehicle.speed_mps: ")


# Values


@pytest.mark.parametrize(
    "setting",
    [
        "memory.budget_mib=-1",
        "memory.budget_mib=0",
        "memory.corners=0",
        "memory.corners=32768",
        "memory.corners=99999999999999999999999",
        "vehicle.half_width_m=0",
        "vehicle.half_width_m=-0.3",
        "camera.width=0",
        "camera.width=1000000",
        "camera.fps=0",
        "camera.fps=1e-300",
        "camera.pitch_rad=1.6",
        "camera.intrinsics=[500, 500, 320]",
        "camera.intrinsics=[500, 500, 320, 240, 0]",
        "camera.intrinsics=[500, -500, 320, 240]",
        "camera.distortion=[0.1]",
        "camera.mask=[[[0, 0], [9, 9]]]",
        "camera.mask=[[[0, 0], [9, 9], [9]]]",
        "camera.mask=[[[0, 0], [9, 9], [5000, 0]]]",
        f"camera.mask={[[[0, 0], [9, 0], [9, 9]]] * 65}",
        f"camera.mask={[[[0, 0]] * 257]}",
        "imu.axes=[[1, 0, 0], [0, 1, 0]]",
        "imu.axes=[[1, 0], [0, 1], [0, 0]]",
        "imu.axes=[[1, 0, 0], [0, 1, 0], [0, 0, -1]]",
        "imu.axes=[[2, 0, 0], [0, 2, 0], [0, 0, 2]]",
        "imu.axes=[[1, 0, 0], [1, 0, 0], [0, 0, 1]]",
        "imu.time_offset_s=1e300",
        "filter.fast_threshold=255",
        "filter.involvement=1.5",
        "filter.tr_cr=3.5",
        "filter.tr_max=2.5",
    ],
)
def test_an_impossible_value_names_the_key(setting: str) -> None:
    key = setting.partition("=")[0]
    text = refused(None, setting)
    assert text.startswith((f"--set: {key}: ", "--set: filter.tr_s: "))


def test_what_goes_together_is_checked_together() -> None:
    for model, count in (("radial-tangential", 4), ("radial-tangential", 5), ("equidistant", 4)):
        settings = [f"camera.distortion_model={model}", f"camera.distortion={[0.1] * count}"]
        assert load(settings=settings).camera.distortion == [0.1] * count
        assert "camera.distortion: " in refused(None, settings[0], f"camera.distortion={[0.1] * 3}")
    assert "vehicle.speed_mps: needed" in refused(None, "vehicle.speed_source=constant")
    assert load(settings=["vehicle.speed_source=constant", "vehicle.speed_mps=1"]).vehicle.speed_mps == 1.0


@pytest.mark.parametrize("table", ["camera", "imu"])
def test_a_stand_in_needs_a_recording(table: str) -> None:
    driver = f"{table}.driver=recording"
    assert refused(None, driver).startswith(f"--set: {table}.recording: needed with {driver}")
    assert load(settings=[driver, f"{table}.recording=drive"])


def test_the_imus_stand_in_may_share_the_cameras_recording() -> None:
    assert load(settings=["imu.driver=recording", "camera.recording=drive"])


def floats() -> list[str]:
    """Every key that holds a number which might not be finite, and how to write one."""
    wide = {"camera.intrinsics": "[{}, 1, 1, 1]", "camera.distortion": "[{}, 0, 0, 0]"}
    wide |= {"imu.axes": FLAT.replace("1.0", "{}", 1), "vehicle.speed_mps": "{}"}
    scalar = {
        f"{name}.{field.name}": "{}"
        for name, table in TABLES.items()
        for field in msgspec.structs.fields(table)
        if isinstance(field.default, float)
    }
    return [f"{key}={form}" for key, form in (scalar | wide).items()]


@pytest.mark.parametrize("form", floats())
def test_what_is_not_finite_is_refused(form: str) -> None:
    model = ("camera.distortion_model=equidistant",) if "distortion=" in form else ()
    for value in ("nan", "inf", "-inf", "1e999"):
        text = refused(None, form.format(value), *model)
        assert text.startswith(f"--set: {form.partition('=')[0]}")


def test_an_integer_too_large_for_a_number_is_refused() -> None:
    assert "vehicle.half_width_m" in refused(None, f"vehicle.half_width_m={'9' * 400}")


# Profiles


def test_the_profile_paper_sets_the_constants_of_the_paper() -> None:
    assert load(settings=["filter.profile=paper"]).filter == PAPER
    assert (PAPER.delta_px, PAPER.bl0_px, PAPER.fast_threshold, PAPER.fast_adaptive) == (4.0, 25.0, 25, False)
    assert (PAPER.tr_cr, PAPER.tr_s, PAPER.tr_max) == (2.0, 3.0, 5.0)
    assert math.isclose(math.degrees(PAPER.eps_beta_rad), 20, abs_tol=0.1)


def test_the_profile_rover_is_the_default() -> None:
    assert load(settings=["filter.profile=rover"]).filter == load().filter == ROVER == Filter()


def test_single_keys_override_the_profile(file: Callable[[str], Path]) -> None:
    path = file("[filter]\nprofile = 'paper'\ndelta_px = 2.5\nbl0_px = 12.0\n")
    config = load(path, ["filter.psi_life_s=1.5"])
    assert config.filter == msgspec.structs.replace(PAPER, delta_px=2.5, bl0_px=12.0, psi_life_s=1.5)
    path = file("[filter]\ndelta_px = 2.5\n")
    assert load(path, ["filter.profile=paper"]).filter == msgspec.structs.replace(PAPER, delta_px=2.5)


# Written down and read back


PLAIN: dict[type, st.SearchStrategy[Any]] = {inspect.BoolType: st.booleans(), inspect.StrType: st.text()}


def values(kind: inspect.Type) -> st.SearchStrategy[Any]:
    """Any value that a key of this type accepts."""
    match kind:
        case inspect.IntType():
            return st.integers(kind.ge, kind.le)
        case inspect.FloatType():
            low, high = (kind.ge if kind.gt is None else kind.gt), (kind.le if kind.lt is None else kind.lt)
            return st.floats(
                low,
                high,
                exclude_min=kind.gt is not None,
                exclude_max=kind.lt is not None,
                allow_nan=False,
                allow_infinity=False,
            )
        case inspect.BoolType() | inspect.StrType():
            return PLAIN[type(kind)]
        case inspect.LiteralType():
            return st.sampled_from(kind.values)
        case inspect.ListType():
            return st.lists(values(kind.item_type), max_size=5)
        case inspect.UnionType():
            return st.one_of([values(each) for each in kind.types if not isinstance(each, inspect.NoneType)])
    raise TypeError(f"no values for {kind}")


def tables(table: type[Table], **given_here: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Any table; ``given_here`` for keys that depend on others."""
    kind = inspect.type_info(table)
    assert isinstance(kind, inspect.StructType)
    every = {field.name: values(field.type) for field in kind.fields}
    return st.builds(table, **(every | given_here))


def numbers(count: int, low: float = -100, high: float = 100) -> st.SearchStrategy[list[float]]:
    return st.lists(st.floats(low, high), min_size=count, max_size=count)


LENSES = st.one_of(
    st.tuples(st.just("none"), st.just([])),
    st.tuples(st.just("radial-tangential"), numbers(4) | numbers(5)),
    st.tuples(st.just("equidistant"), numbers(4)),
)
CAMERAS = LENSES.flatmap(
    lambda lens: tables(
        Camera,
        distortion_model=st.just(lens[0]),
        distortion=st.just(lens[1]),
        intrinsics=st.just([]) | numbers(4, 1e-3, 1e6),
        recording=st.text(min_size=1),
        height=st.integers(1, 2048),
        height_m=st.just(0.0) | st.floats(0.001, 10_000),
        mask=st.lists(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(list), min_size=3, max_size=5)),
    )
)
AXES = st.sampled_from(([], [[0, 1, 0], [0, 0, 1], [1, 0, 0]], [[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]))
TRUSTS = st.lists(st.floats(0, 100), min_size=3, max_size=3).map(sorted)
FILTERS = TRUSTS.flatmap(
    lambda trusts: tables(Filter, **dict(zip(("tr_cr", "tr_s", "tr_max"), map(st.just, trusts), strict=True)))
)
HOSTS = st.text(st.characters(exclude_characters="?#[", exclude_categories=("Cs",)), min_size=1)
ENDPOINTS = st.builds(
    "{}/{}:{}{}".format,
    st.sampled_from(("tcp", "tls", "unixsock-stream")),
    HOSTS,
    st.integers(0, 65535),
    st.just("") | st.text().map("#{}".format),
)
CONFIGS = st.builds(
    Config,
    camera=CAMERAS,
    imu=tables(Imu, axes=AXES, recording=st.text(min_size=1)),
    vehicle=tables(Vehicle, speed_mps=st.floats(-70, 70)),
    filter=FILTERS,
    **{name: tables(TABLES[name]) for name in ("memory", "publish")},
    zenoh=tables(Zenoh, connect=st.lists(ENDPOINTS), listen=st.lists(ENDPOINTS)),
)


@settings(max_examples=60)
@given(config=CONFIGS)
def test_written_as_toml_it_is_read_back_the_same(config: Config, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "round_trip.toml"
    path.write_text(to_toml(config), encoding="utf-8", newline="\n")
    assert load(path) == config


def test_what_a_terminal_would_obey_is_written_escaped(file: Callable[[str], Path]) -> None:
    path = file('[publish]\nrobot = "\\u001b[31m\\u009b31m\u202e\U000e0001\\u007f ψ"\n')
    config = load(path)
    text = to_toml(config)
    assert all(line.isprintable() for line in text.splitlines())
    assert "ψ" in text
    assert load(file(text)) == config


def test_every_key_is_written() -> None:
    text = to_toml(Config())
    for name, table in TABLES.items():
        assert f"[{name}]\n" in text
        for field in msgspec.structs.fields(table):
            assert f"\n{field.name} = " in text or field.default is None


# Memory


def test_tables_that_need_more_than_the_budget_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    large = ["--set", "memory.budget_mib=2", "--set", "memory.edges_normal=30000"]
    assert main(["config", *large]) == 2
    output, errors = capsys.readouterr()
    assert output == ""
    (line,) = errors.splitlines()
    assert line.startswith("lcf-edge: memory.budget_mib: the tables need ")
    assert "lower the other keys of memory" in line
    assert "edges" in line


def test_the_shipped_tables_take_a_small_part_of_their_budget() -> None:
    assert main(["config", "--set", f"memory.budget_mib={Memory().budget_mib / 20}"]) == 0


@pytest.mark.parametrize("key", ["before_s", "after_s"])
def test_a_threat_is_saved_with_an_hour_around_it_at_most(key: str) -> None:
    assert getattr(load(None, [f"record.{key}=3600"]).record, key) == 3600
    assert f"record.{key}" in refused(None, f"record.{key}=1e300")
