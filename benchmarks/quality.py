"""Detection quality: every kind of drive with several seeds, and the real recordings, for every method."""

import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from benchmarks.methods import FILTER, MAP, NAMES
from benchmarks.peers.peer import Circles
from benchmarks.playing import config_of, play_drive, play_recording
from benchmarks.report import Table, number
from benchmarks.score import Score, pool, score
from hil_mocks import scenes
from hil_mocks.truth import Truth
from lcf_edge.config import PAPER, Camera, Config, Vehicle
from lcf_edge.records import Kind, Scene

MIN_TRUST = 3.0
_RATIOS = (
    "f1",
    "strict_f1",
    "recall",
    "precision",
    "latency_s",
    "ttc_error",
    "false_per_quiet_frame",
    "omitted_share",
)


@dataclass(frozen=True, slots=True)
class Size:
    """Rows that are kept at the end of a drive."""

    landmarks: int  # of a map of all corners
    tables: int  # of the filter, all tables together


@dataclass(frozen=True, slots=True)
class Quality:
    """What was scored: by kind of drive, and one score a seed."""

    scores: dict[str, dict[str, list[Score]]] = field(default_factory=dict)  # kind, method, one a seed
    sizes: dict[str, list[Size]] = field(default_factory=dict)  # kind, one a seed
    recordings: list[dict[str, str | float]] = field(default_factory=list)


def run_drives(kinds: Sequence[str], seeds: Sequence[int], into: Quality) -> Iterable[str]:
    """Score all methods; answers with the name of each drive that is done."""
    for kind in kinds:
        by_method: dict[str, list[Score]] = {name: [] for name in NAMES}
        sizes: list[Size] = []
        for seed in seeds:
            drive = scenes.make(kind, seed)
            said: dict[str, list[Scene]] = {name: [] for name in (*NAMES, MAP)}
            truths: list[Truth] = []
            for moment in play_drive(drive, config_of(drive), (*NAMES, MAP)):
                assert moment.truth is not None
                truths.append(moment.truth)
                for name, scene in moment.scenes.items():
                    said[name].append(scene)
            for name in NAMES:
                by_method[name].append(score(said[name], truths, min_trust=MIN_TRUST))
            last = said[FILTER][-1].sizes
            rows = last.edges_normal + last.edges_rebel + last.circles_normal + last.circles_rebel
            sizes.append(Size(said[MAP][-1].sizes.edges_normal, rows + last.groups + last.psi))
            yield f"{kind} {seed}"
        into.scores[kind] = by_method
        into.sizes[kind] = sizes


def data_folder() -> Path:
    """Where the real recordings are, if they are."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    return Path(os.environ.get("LCF_EDGE_DATA", beside))


def run_recordings(into: Quality) -> Iterable[str]:
    """The real recordings that are at hand; answers with the name of each that is done."""
    for name, config, measures in _RECORDINGS:
        path = data_folder() / name
        if not path.is_dir():
            continue
        moments = [moment.scenes for moment in play_recording(path, config, NAMES)]
        for title, measure in measures.items():
            means = {method: float(np.mean([measure(said[method]) for said in moments])) for method in NAMES}
            into.recordings.append({"recording": name, "measure": title, **means})
        yield name


def _shown(scene: Scene) -> Circles:
    circles = scene.circles
    shown: Circles = circles[(circles["kind"] == Kind.REBEL) & (circles["trust"] >= MIN_TRUST)]
    return shown


def _circles(scene: Scene) -> float:
    return float(len(_shown(scene)))


def _on_middle_third(scene: Scene) -> float:
    x = _shown(scene)["x"]
    third = scene.image_width / 3
    return float(bool(((x >= third) & (x <= 2 * third)).any()))


_KITTI = Config(camera=Camera(height_m=1.65), vehicle=Vehicle(half_width_m=1.2, horizon_s=4.0))
# A picture every 7 s, and contact minutes ahead: at 1 cm/s, ranges come out in metres.
_RIG = Config(
    camera=Camera(fps=1 / 7, height_m=0.15),
    vehicle=Vehicle(half_width_m=0.2, horizon_s=400.0, speed_source="constant", speed_mps=0.01),
    filter=PAPER,
)
_RECORDINGS: tuple[tuple[str, Config, dict[str, Callable[[Scene], float]]], ...] = (
    ("kitti-straight", _KITTI, {"circles a frame, all false": _circles}),
    (
        "authors-rig-2020",
        _RIG,
        {"frames with a circle on the middle third": _on_middle_third, "circles a frame": _circles},
    ),
)


def tables(quality: Quality) -> list[Table]:
    """F1 by kind and method, then the details of each method, sizes and recordings."""
    pooled = {kind: {name: pool(each) for name, each in methods.items()} for kind, methods in quality.scores.items()}
    answer = [_f1_table(pooled)] if pooled else []
    answer += [_details(name, pooled) for name in NAMES if pooled]
    if quality.sizes:
        answer.append(_sizes(quality.sizes))
    if quality.recordings:
        rows = [
            [str(row["recording"]), str(row["measure"]), *(number(row[n], 2) for n in NAMES)]
            for row in quality.recordings
        ]
        answer.append(Table("Real recordings", ["recording", "measure", *NAMES], rows))
    return answer


def as_numbers(each: Score) -> dict[str, float]:
    """Counts and ratios of one score."""
    counts = {item.name: getattr(each, item.name) for item in fields(Score) if item.type is int}
    return counts | {name: getattr(each, name) for name in _RATIOS}


def summary(quality: Quality) -> dict[str, dict[str, float]]:
    """Over all kinds, of each method: what the goals are about."""
    answer = {}
    for name in NAMES:
        kinds = {kind: pool(methods[name]) for kind, methods in quality.scores.items()}
        f1 = [each.f1 for each in kinds.values() if each.targets]
        every = pool(kinds.values())
        answer[name] = {
            "mean_f1": float(np.mean(f1)) if f1 else math.nan,
            "worst_f1": min(f1, default=math.nan),
            "recall": every.recall,
            "precision": every.precision,
            "latency_s": every.latency_s,
            "ttc_error": every.ttc_error,
            "false_per_quiet_frame": every.false_per_quiet_frame,
            "psi_on_threat_frames": every.psi_on_threat_frames,
            "omitted_share": every.omitted_share,
        }
    return answer


def _f1_table(pooled: dict[str, dict[str, Score]]) -> Table:
    threatened = [kind for kind, methods in pooled.items() if methods[FILTER].targets]
    rows = []
    for kind, methods in pooled.items():
        f1 = [number(methods[name].f1, 3) if kind in threatened else "no threat" for name in NAMES]
        rows.append([kind, *f1])
    for title, of in (("**mean**", np.mean), ("**worst**", np.min)):
        every = [[pooled[kind][name].f1 for kind in threatened] for name in NAMES]
        rows.append([title, *(number(float(of(f1)) if f1 else math.nan, 3) for f1 in every)])
    return Table("F1 of rebel circles a frame", ["scene", *NAMES], rows)


def _details(name: str, pooled: dict[str, dict[str, Score]]) -> Table:
    columns = ["scene", "F1", "recall", "precision", "latency s", "TTC error", "false/quiet frame", "never hit"]
    columns += ["ψ on target", "ψ saved"] if name == FILTER else []
    rows = []
    for kind, methods in pooled.items():
        each = methods[name]
        row = [
            kind,
            number(each.f1 if each.targets else math.nan, 3),
            number(each.recall, 3),
            number(each.precision, 3),
        ]
        row += [number(each.latency_s, 2), number(each.ttc_error, 2), number(each.false_per_quiet_frame, 3)]
        row.append(f"{each.targets_never_hit}/{each.targets}")
        if name == FILTER:
            row += [str(each.psi_on_threat_frames), number(each.omitted_share, 2)]
        rows.append(row)
    return Table(f"Details: {name}", columns, rows)


def _sizes(sizes: dict[str, list[Size]]) -> Table:
    rows = [
        [
            kind,
            number(float(np.mean([s.landmarks for s in each])), 0),
            number(float(np.mean([s.tables for s in each])), 0),
        ]
        for kind, each in sizes.items()
    ]
    return Table(
        "Rows kept at the end of a drive", ["scene", "map of all FAST-9 landmarks", "all tables of the filter"], rows
    )
