"""Every number of the configuration has bounds, and within them the pipeline runs: no exception, not even a warning."""

import tracemalloc
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec import inspect

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config, load
from lcf_edge.errors import ConfigError
from lcf_edge.lens import NARROWEST, WIDEST, Lens
from lcf_edge.pipeline import Pipeline

WIDTH, HEIGHT = 160, 120
SMALL_TABLES = [f"memory.{name}=60" for name in ("corners", "edges_normal", "edges_rebel", "chains")]


def numbers() -> Iterator[tuple[str, inspect.IntType | inspect.FloatType]]:
    """Every key that is one number or a list of numbers, and the type of the number."""
    for table in msgspec.structs.fields(Config):
        for field in msgspec.structs.fields(table.type):
            kind = inspect.type_info(field.type)
            while isinstance(kind, inspect.ListType | inspect.UnionType):
                inner = kind.types[0] if isinstance(kind, inspect.UnionType) else kind.item_type
                kind = inner
            if isinstance(kind, inspect.IntType | inspect.FloatType):
                yield f"{table.name}.{field.name}", kind


NUMBERS = dict(numbers())


@pytest.mark.parametrize("key", NUMBERS)
def test_every_number_has_an_upper_and_a_lower_bound(key: str) -> None:
    kind = NUMBERS[key]
    low, high = (kind.ge if kind.gt is None else kind.gt), (kind.le if kind.lt is None else kind.lt)
    assert low is not None
    assert high is not None
    assert -4e9 <= low < high <= 4e9


def within(kind: inspect.IntType | inspect.FloatType) -> st.SearchStrategy[Any]:
    """Numbers of a type, its ends above all."""
    low, high = (kind.ge if kind.gt is None else kind.gt), (kind.le if kind.lt is None else kind.lt)
    assert low is not None
    assert high is not None
    if isinstance(kind, inspect.IntType):
        return st.sampled_from((low, high)) | st.integers(int(low), int(high))
    ends = [end for end, open_end in ((low, kind.gt), (high, kind.lt)) if open_end is None]
    some = st.floats(low, high, exclude_min=kind.gt is not None, exclude_max=kind.lt is not None)
    return st.sampled_from(ends) | some if ends else some


PIPELINE_TABLES = ("camera", "imu", "vehicle", "filter", "memory")
LISTS = {"camera.intrinsics", "camera.distortion", "camera.mask", "imu.axes"}
OTHERS = {"camera.fps", "camera.gain", "imu.bus", "imu.address", "imu.baud", "camera.width", "camera.height"}
SCALARS = {
    key: within(kind)
    for key, kind in NUMBERS.items()
    if key.partition(".")[0] in PIPELINE_TABLES and key not in LISTS | OTHERS
}
SINGLE = st.sampled_from(sorted(SCALARS)).flatmap(lambda key: SCALARS[key].map(lambda value: f"{key}={value!r}"))
COEFFICIENTS = st.sampled_from((0.0, 1e-320, -1e-320, 1e-12, 0.1, -0.1, 1.0, -1.0, 100.0, -100.0)) | st.floats(
    -100, 100
)
FOCAL = st.sampled_from((WIDTH / WIDEST, 1.0, 100.0, WIDTH * float(NARROWEST))) | st.floats(0.5, 200_000)
MIDDLE = st.sampled_from((-10.0 * WIDTH, 0.0, 80.0, 10.0 * WIDTH)) | st.floats(-2000, 2000)


@st.composite
def lenses(draw: st.DrawFn) -> list[str]:
    model, count = draw(
        st.sampled_from((("none", 0), ("radial-tangential", 4), ("radial-tangential", 5), ("equidistant", 4)))
    )
    bent = [draw(COEFFICIENTS) for _ in range(count)]
    lines = [f"camera.distortion_model={model}", f"camera.distortion={bent}"]
    if draw(st.booleans()):
        lines += [f"camera.intrinsics={[draw(FOCAL), draw(FOCAL), draw(MIDDLE), draw(MIDDLE)]}"]
        lines += [f"camera.width={WIDTH}", f"camera.height={HEIGHT}"]
    return lines


def drive(pipeline: Pipeline, approach: Callable[..., Any]) -> int:
    """Six images with everything that belongs to them. Return the scenes."""
    scenes = 0
    for item in approach(frames=6, lens=Lens(WIDTH, HEIGHT, 125.0, 125.0, 79.5, 59.5)):
        if isinstance(item, Frame):
            scene = pipeline.process(item)
            pipeline.view()
            assert np.isfinite(scene.circles["x"]).all()
            scenes += 1
        else:
            assert isinstance(item, ImuSample | SpeedSample)
            pipeline.add(item)
    return scenes


def built(lines: list[str]) -> Pipeline | str:
    """A pipeline of a configuration that passes, or why it is refused."""
    try:
        config = load(None, [*SMALL_TABLES, *lines])
        return Pipeline(config, Lens.from_config(config.camera, WIDTH, HEIGHT))
    except ConfigError as error:
        return str(error)


def check(lines: list[str], approach: Callable[..., Any]) -> None:
    """What passes builds a pipeline that runs; what does not is refused in one line."""
    pipeline = built(lines)
    if isinstance(pipeline, str):
        assert "\n" not in pipeline
    else:
        assert drive(pipeline, approach) == 6


@settings(max_examples=150)
@given(lines=st.lists(SINGLE, min_size=1, max_size=6))
def test_a_pipeline_runs_with_every_number_at_its_bounds(lines: list[str], approach: Callable[..., Any]) -> None:
    check(lines, approach)


@settings(max_examples=100)
@given(lines=lenses())
@example(lines=["camera.distortion_model=radial-tangential", "camera.distortion=[0.1, 1e-320, 0, 1e-320]"])
def test_a_pipeline_runs_with_every_lens_that_passes(lines: list[str], approach: Callable[..., Any]) -> None:
    check(lines, approach)


@pytest.mark.parametrize("key", sorted(SCALARS))
def test_each_bound_by_itself_runs(key: str, approach: Callable[..., Any]) -> None:
    kind = NUMBERS[key]
    for value in (end for end in (kind.ge, kind.le) if end is not None):
        pipeline = built([f"{key}={value}"])
        if isinstance(pipeline, str):
            assert key in {"memory.budget_mib", "filter.tr_cr", "filter.tr_s", "filter.tr_max"}, pipeline
        else:
            assert drive(pipeline, approach) == 6


@pytest.mark.parametrize(
    "setting",
    [
        f"camera.gain={'9' * 400}",
        "camera.exposure_s=1e308",
        "camera.distortion=[0.1, 1e300, 0, 0]",
        "camera.intrinsics=[1e300, 1, 1, 1]",
        "filter.leap_px=1e12",
        "filter.bl0_px=1e12",
        "filter.bs_px=1e160",
        "filter.corner_noise_px=1e-320",
        "camera.height_m=1e-190",
        "vehicle.speed_mps=1e300",
    ],
)
def test_what_once_ended_a_reload_is_refused_by_its_key(setting: str) -> None:
    refused = built([setting, "camera.distortion_model=radial-tangential"])
    assert isinstance(refused, str)
    assert setting.partition("=")[0] in refused
    assert len(refused) < 200


def test_more_pixels_than_an_image_may_have_are_refused() -> None:
    refused = built(["camera.width=16384", "camera.height=16384"])
    assert isinstance(refused, str)
    assert "camera.width: more than 33554432 pixels" in refused


def test_wide_gates_take_no_more_memory(approach: Callable[..., Any]) -> None:
    """The budget is checked without regard to them."""
    peaks = []
    widest = [f"{key}={NUMBERS[key].le}" for key in ("filter.leap_px", "filter.bl0_px")]
    for gates in ([], widest):
        pipeline = built(gates)
        assert isinstance(pipeline, Pipeline)
        tracemalloc.start()
        try:
            drive(pipeline, approach)
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    assert peaks[1] < peaks[0] + 100_000
