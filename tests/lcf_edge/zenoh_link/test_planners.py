"""The programs for planners decode what is sent, as far as their compilers are here."""

import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import zenoh

from lcf_edge.cdr import encode_scene
from lcf_edge.config import Config, Publish, Zenoh
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, ObjectClass, Scene
from lcf_edge.zenoh_link import ScenePublisher

ROOT = Path(__file__).parents[3]
DOCUMENT = (ROOT / "docs/planners.md").read_text(encoding="utf-8")
PATIENCE_S = 20.0

PRINT_CPP = """
#include <cstdio>
#include <fstream>
#include <iterator>
#include "scene.hpp"
int main(int, char** files) {
  while (*++files) {
    std::ifstream file(*files, std::ios::binary);
    std::vector<uint8_t> payload{std::istreambuf_iterator<char>(file), {}};
    try {
      const Scene s = decode(payload);
      std::printf("%lld %llu %u %u %g", (long long)s.stamp_ns, (unsigned long long)s.frame_seq, s.image_width,
                  s.image_height, s.vehicle_speed);
      for (const auto& c : s.circles) std::printf(" %u %u %u %g %g", c.id, c.kind, c.support, c.x, c.lateral);
      for (const auto& p : s.psi) std::printf(" %u %u %g %g", p.id, p.shape, p.x, p.trust);
      for (const auto& o : s.objects)
        std::printf(" %u %u %u %u %g %g %g %g %g %g", o.id, o.class_id, o.state, o.support, o.height, o.ttc,
                    o.range_sigma, o.closest, o.probability, o.unseen);
      std::printf("\\n");
    } catch (const std::exception&) { std::printf("no scene\\n"); }
  }
}
"""

PRINT_RUST = """
mod scene;
fn main() {
    for file in std::env::args().skip(1) {
        let Some(s) = scene::decode(&std::fs::read(file).unwrap()) else { println!("no scene"); continue };
        print!("{} {} {} {} {}", s.stamp_ns, s.frame_seq, s.image_width, s.image_height, s.vehicle_speed);
        for c in &s.circles { print!(" {} {} {} {} {}", c.id, c.kind, c.support, c.image[0], c.world[4]); }
        for p in &s.psi { print!(" {} {} {} {}", p.id, p.shape, p.image[0], p.image[4]); }
        for o in &s.objects {
            print!(" {} {} {} {} {} {}", o.id, o.class_id, o.state, o.support, o.image[3], o.ttc[0]);
            print!(" {} {} {} {}", o.range[1], o.closest[0], o.probability, o.unseen);
        }
        println!();
    }
}
"""


SHOWN = ["id", "class_id", "state", "support", "height", "ttc", "range_sigma", "closest", "probability", "unseen"]


def printed(words: list[Any]) -> str:
    return " ".join(f"{word:g}" if isinstance(word, float) else str(word) for word in words)


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", DOCUMENT, re.MULTILINE | re.DOTALL)


def filled(dtype: np.dtype[np.void], rows: int) -> Any:
    records = np.zeros(rows, dtype)
    for number, name in enumerate(dtype.names or ()):
        records[name] = np.arange(rows) + number
    return records


@pytest.fixture
def payloads(tmp_path: Path) -> tuple[list[str], list[str]]:
    """Files, and what is said of them."""
    files, said = [], []
    for frame_id in ("", "c", "camera", "camera_link"):
        for circles, psi, objects in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (3, 2, 2)):
            tables = filled(CIRCLE, circles), filled(PSI_REGION, psi)
            things = filled(OBJECT, objects)
            scene = Scene(1_700_000_000_123_456_789, 2**40, 640, 480, 1.5, *tables, objects=things)
            path = tmp_path / f"scene-{frame_id}-{circles}-{psi}-{objects}"
            path.write_bytes(encode_scene(scene, frame_id))
            words = [scene.stamp_ns, scene.seq, 640, 480, 1.5]
            for row in scene.circles[["id", "kind", "support", "x", "lateral"]].tolist():
                words += row
            for row in scene.psi[["id", "shape", "x", "trust"]].tolist():
                words += row
            before = len(words)
            for row in scene.objects[SHOWN].tolist():
                words += row
            files.append(str(path))
            said.append(printed(words))
    whole = Path(files[-1]).read_bytes()
    before_objects = whole[: -4 - 2 * OBJECT.itemsize]
    old = tmp_path / "before-objects"
    old.write_bytes(before_objects)
    files.append(str(old))
    said.append(printed(words[:before]))
    for length in (0, 3, 4, 20, 60, len(before_objects) - 1, len(before_objects) + 1, len(whole) - 1):
        path = tmp_path / f"cut-{length}"
        path.write_bytes(whole[:length])
        files.append(str(path))
        said.append("no scene")
    return files, said


@pytest.mark.parametrize(
    ("language", "name", "main", "command"),
    [
        ("cpp", "scene.hpp", PRINT_CPP, "g++ -std=c++17 -Wall -Wextra -Werror -fsanitize=undefined -o print main.cpp"),
        ("rust", "scene.rs", PRINT_RUST, "rustc --edition 2021 -A dead_code -o print main.rust"),
    ],
    ids=["C++", "Rust"],
)
def test_a_program_decodes_scenes(
    tmp_path: Path, payloads: tuple[list[str], list[str]], language: str, name: str, main: str, command: str
) -> None:
    compiler, *arguments = command.split()
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler} here")
    shutil.copy(ROOT / "examples" / language / name, tmp_path)
    (tmp_path / f"main.{language}").write_text(main)
    subprocess.run((compiler, *arguments), cwd=tmp_path, check=True, timeout=120)
    files, said = payloads
    done = subprocess.run((str(tmp_path / "print"), *files), check=True, capture_output=True, text=True)
    assert done.stdout.splitlines() == said


def test_the_python_program_slows_down_for_what_will_probably_be_met(
    session: zenoh.Session, endpoint: str, scene: Callable[..., Scene]
) -> None:
    code = blocks("python")[0].replace("tcp/127.0.0.1:7447", endpoint)
    objects = np.zeros(3, OBJECT)
    objects["class_id"] = ObjectClass.STANDING, ObjectClass.CROSSING, ObjectClass.ONCOMING
    objects["ttc"], objects["ttc_sigma"] = (0.5, 2.25, 3.0), (0.1, 0.125, np.nan)
    objects["bearing"], objects["probability"] = (0.0, -0.25, 0.5), (0.25, 0.75, 0.5)
    publisher = ScenePublisher(session, Publish())
    with subprocess.Popen((sys.executable, "-u", "-c", code), stdout=subprocess.PIPE, text=True) as planner:
        try:
            assert publisher.wait_for_subscriber(PATIENCE_S)
            publisher.put(replace(scene(41), objects=objects))
            assert planner.stdout
            assert [planner.stdout.readline() for _ in range(3)] == [
                "41: 0.75 m/s\n",
                "  crossing at -0.25 rad, contact in 2.2 ± 0.1 s\n",
                "  oncoming at 0.50 rad, contact in 3.0 ± nan s\n",
            ]
        finally:
            planner.kill()


@pytest.fixture(scope="module")
def rule() -> Any:
    """The rule of the Python program, without its loop."""
    names: dict[str, Any] = {}
    exec(blocks("python")[0].partition("\nfor scene in")[0], names)
    return names


def test_it_cruises_where_nothing_is_met(rule: Any) -> None:
    objects = np.zeros(2, OBJECT)
    objects["probability"], objects["ttc"] = (0.0, 0.4), (1.0, np.inf)
    assert rule["target_mps"](objects) == rule["target_mps"](objects[:0]) == rule["CRUISE_MPS"]


def test_it_stops_for_what_is_met_at_a_time_that_is_unknown_or_over(rule: Any) -> None:
    for ttc in (np.nan, 0.0, -1.0):
        objects = np.zeros(1, OBJECT)
        objects["probability"], objects["ttc"] = 0.9, ttc
        assert rule["target_mps"](objects) == 0


def test_what_is_written_into_the_configuration_is_understood() -> None:
    (text,) = blocks("toml")
    config = msgspec.convert(tomllib.loads(text), Config)
    assert config.zenoh == Zenoh(connect=["tcp/localhost:7447"], listen=[], gossip=True)
    assert config.publish == Publish(ros2=True)


def test_python_is_python() -> None:
    for code in blocks("python"):
        compile(code, "docs/planners.md", "exec")
