"""Detection quality: every kind of drive with several seeds, for every method."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from benchmarks.methods import FILTER, MAP, NAMES
from benchmarks.playing import config_of, play_drive
from benchmarks.report import Table, number
from benchmarks.score import Score, pool, score
from lcf_edge.messages import Scene
from lcf_edge.rendered import scenes
from lcf_edge.rendered.truth import Truth

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
    """Scores by kind of drive, one per seed."""

    scores: dict[str, dict[str, list[Score]]] = field(default_factory=dict)  # kind, method, one a seed
    sizes: dict[str, list[Size]] = field(default_factory=dict)  # kind, one a seed


def run_drives(kinds: Sequence[str], seeds: Sequence[int], into: Quality) -> Iterable[str]:
    """Score all methods. Return the name of each drive that is done."""
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


def tables(quality: Quality) -> list[Table]:
    """F1 by kind and method, then the details of each method, and sizes."""
    pooled = {kind: {name: pool(each) for name, each in methods.items()} for kind, methods in quality.scores.items()}
    answer = [_f1_table(pooled)] if pooled else []
    answer += [_details(name, pooled) for name in NAMES if pooled]
    if quality.sizes:
        answer.append(_sizes(quality.sizes))
    return answer


def as_numbers(each: Score) -> dict[str, float]:
    """Counts and ratios of one score."""
    counts = {item.name: getattr(each, item.name) for item in fields(Score) if item.type is int}
    return counts | {name: getattr(each, name) for name in _RATIOS}


def summary(quality: Quality) -> dict[str, dict[str, float]]:
    """The figures that have goals, of each method, over all kinds."""
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
