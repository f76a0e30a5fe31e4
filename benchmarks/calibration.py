"""``python -m benchmarks.calibration``: accuracy of objects' numbers, and whether their sigmas are consistent.

The planner with ground truth drives through worlds of the closed loop while the pipeline observes; or rendered drives
are played. Every object is compared with the body that it lies on: the one whose box in the image overlaps its own
most and contains its centre (grown by a quarter and 8 px).
"""

import argparse
import math
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt
from tqdm import tqdm

from benchmarks import report
from benchmarks.drivers import CIRCLES, OBJECTS, TruthDriver, method_of, objects_of_circles, reported_objects
from benchmarks.methods import FILTER
from benchmarks.playing import config_of, play_drive
from benchmarks.report import Table, number
from hil_mocks.closed_loop import worlds
from hil_mocks.closed_loop.exact import Exact, exact_of_drive
from hil_mocks.closed_loop.loop import Moment, drive
from hil_mocks.closed_loop.world import World
from lcf_edge.messages import ObjectClass, ObjectState, Scene
from lcf_edge.printable import counted
from lcf_edge.rendered import scenes
from lcf_edge.rendered.projection import Stage

_GROWN_SHARE, _GROWN_PX = 0.25, 8.0
_NEAR_S = 4.0  # time to contact below which the goals apply
_GRACE_S = 0.3  # time in sight before it counts
_HIDDEN_S = 0.5  # time out of sight over which an id must be kept
_SPAN_S = 1.0  # shorter appearances do not count for ids
_ASIDE_M, _ASIDE_MPS = 0.3, 0.3  # beside the half width, and outwards: somebody who leaves
_IMMINENT_S, _IMMINENT_M = 2.0, 0.2
_BANDS_M = (0.0, 3.0, 6.0, 12.0, math.inf)
_QUANTITIES = {  # of an object: the truth's name, whether its error is relative
    "ttc": ("ttc_s", True),
    "range": ("range_m", True),
    "lateral": ("lateral_m", False),
    "closest": ("closest_s", False),
    "bearing": ("bearing_rad", False),
    "elevation": ("elevation_rad", False),
    "v_forward": ("v_forward_mps", False),
    "v_right": ("v_right_mps", False),
}
_SPLIT = ("ttc", "range", "lateral")  # quantities whose sigmas are shown by class and range

Objects = npt.NDArray[np.void]


@dataclass(frozen=True, slots=True)
class Pair:
    """An object in sight and the body that it lies on."""

    body: Exact
    values: dict[str, float]
    sigmas: dict[str, float]
    class_id: int
    probability: float

    @property
    def near(self) -> bool:
        """Contact comes soon."""
        return self.body.ttc_s < _NEAR_S

    def error(self, quantity: str) -> float:
        """Signed; NaN: no number, or no truth."""
        name, relative = _QUANTITIES[quantity]
        true = float(getattr(self.body, name))
        if not math.isfinite(true):
            return math.nan
        error = self.values[quantity] - true
        return error / max(abs(true), 0.1) if relative else error

    def known(self, quantity: str) -> bool:
        """Whether there is a truth to compare with."""
        return math.isfinite(float(getattr(self.body, _QUANTITIES[quantity][0])))

    def sigmas_off(self, quantity: str) -> float:
        """Error divided by its own sigma; NaN: not known."""
        true = float(getattr(self.body, _QUANTITIES[quantity][0]))
        sigma = self.sigmas[quantity]
        return (self.values[quantity] - true) / sigma if sigma > 0 else math.nan


@dataclass
class _Sight:
    """A walker while he is in sight."""

    first_s: float
    last_s: float
    ids: list[int] = field(default_factory=list)  # one a frame in which an object lay on him


@dataclass
class Calibration:
    """Statistics so far; ``see`` takes one frame after the other of each drive."""

    pairs: list[Pair] = field(default_factory=list)
    objects_of_walkers: list[int] = field(default_factory=list)  # how many lay on a walker in sight, a frame each
    sights: list[_Sight] = field(default_factory=list)
    threats: int = 0  # in sight, contact soon, a frame each
    threats_found: int = 0
    leaving: int = 0  # objects on somebody who leaves to the side, a frame each
    leaving_standing: int = 0
    leaving_imminent: int = 0
    objects: int = 0  # in sight
    on_nothing: int = 0
    on_nothing_imminent: int = 0
    _open: dict[tuple[str, int], _Sight] = field(default_factory=dict)
    _since: dict[tuple[str, int], float] = field(default_factory=dict)

    def see(self, drive: str, time_s: float, objects: Objects, known: Sequence[Exact], half_width_m: float) -> None:
        """Compare one frame's objects with its truth."""
        seen = objects[objects["state"] == ObjectState.SEEN]
        on = match(seen, known)
        lying: dict[int, list[np.void]] = defaultdict(list)
        for thing, body in zip(seen, on, strict=True):
            imminent = _imminent(thing, half_width_m)
            self.objects += 1
            if body is None:
                self.on_nothing += 1
                self.on_nothing_imminent += imminent
                continue
            lying[body.number].append(thing)
            if body.in_sight:
                self.pairs.append(_pair(thing, body))
            outwards = body.v_right_mps * body.beside_m > 0 and abs(body.v_right_mps) > _ASIDE_MPS
            if outwards and abs(body.beside_m) > half_width_m + _ASIDE_M and not body.threat:
                self.leaving += 1
                self.leaving_standing += int(thing["class_id"] == ObjectClass.STANDING)
                self.leaving_imminent += imminent
        for body in known:
            key = drive, body.number
            if not body.in_sight:
                self._since.pop(key, None)
                continue
            settled = time_s - self._since.setdefault(key, time_s) >= _GRACE_S
            if settled and body.threat and body.ttc_s < _NEAR_S:
                self.threats += 1
                self.threats_found += bool(lying[body.number])
            if body.name.startswith(("walker", "far_walker")):
                if settled and body.moving:
                    self.objects_of_walkers.append(len(lying[body.number]))
                self._keep(key, time_s, lying[body.number])

    def _keep(self, key: tuple[str, int], time_s: float, things: Sequence[np.void]) -> None:
        sight = self._open.get(key)
        if sight is None or time_s - sight.last_s > _HIDDEN_S:
            sight = self._open[key] = _Sight(time_s, time_s)
            self.sights.append(sight)
        sight.last_s = time_s
        ids = [int(thing["id"]) for thing in things]
        if ids:
            before = sight.ids[-1] if sight.ids else None
            sight.ids.append(before if before is not None and before in ids else ids[0])


def match(objects: Objects, known: Sequence[Exact]) -> list[Exact | None]:
    """Return for each object the body that it lies on."""
    found: list[Exact | None] = []
    for thing in objects:
        x, y, width, height = (float(thing[name]) for name in ("x", "y", "width", "height"))
        best, most = None, -1.0
        for body in known:
            left, top, wide, tall = body.box
            across, along = _GROWN_SHARE * wide + _GROWN_PX, _GROWN_SHARE * tall + _GROWN_PX
            if not (left - across <= x <= left + wide + across and top - along <= y <= top + tall + along):
                continue
            shared = max(min(x + width / 2, left + wide) - max(x - width / 2, left), 0.0)
            shared *= max(min(y + height / 2, top + tall) - max(y - height / 2, top), 0.0)
            overlap = shared / max(width * height + wide * tall - shared, 1.0) * max(body.visible, 0.01)
            if overlap > most:
                best, most = body, overlap
        found.append(best)
    return found


def _pair(thing: np.void, body: Exact) -> Pair:
    return Pair(
        body,
        {name: float(thing[name]) for name in _QUANTITIES},
        {name: float(thing[f"{name}_sigma"]) for name in _QUANTITIES},
        int(thing["class_id"]),
        float(thing["probability"]),
    )


def _imminent(thing: np.void, half_width_m: float) -> bool:
    """Whether a planner would brake hard for it."""
    soon = thing["ttc"] < _IMMINENT_S and abs(thing["lateral"]) < half_width_m + _IMMINENT_M
    return bool(soon or thing["probability"] >= 0.5)


# Tables.


def tables(found: Calibration) -> list[Table]:
    """Goals first, then errors and sigmas by class and distance, classes, probabilities."""
    return [
        _goals(found),
        _errors(found, "class"),
        _errors(found, "range"),
        _sigmas(found),
        _sigmas_by(found, "class"),
        _sigmas_by(found, "range"),
        _classes(found),
        _chances(found),
    ]


def _share(part: float, whole: float) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "-"


def _goals(found: Calibration) -> Table:
    near = [pair for pair in found.pairs if pair.near]
    aside = [pair for pair in near if pair.known("lateral")]
    walkers = found.objects_of_walkers
    long = [sight for sight in found.sights if sight.last_s - sight.first_s >= _SPAN_S and sight.ids]
    whole = sum(len(set(sight.ids)) == 1 for sight in long)
    longest = sum(max(sight.ids.count(each) for each in set(sight.ids)) for sight in long)
    rows = [
        ("contact below 4 s: contact within 15 %", "90 %", _share(_within(near, "ttc", 0.15), len(near)), len(near)),
        (
            "contact below 4 s: lateral within 0.3 m",
            "90 %",
            _share(_within(aside, "lateral", 0.3), len(aside)),
            len(aside),
        ),
        (
            "contact below 4 s: range known",
            "95 %",
            _share(sum(math.isfinite(p.values["range"]) for p in near), len(near)),
            len(near),
        ),
        (
            "threats with contact below 4 s: an object lies on it",
            "",
            _share(found.threats_found, found.threats),
            found.threats,
        ),
        ("walkers: one object", "95 %", _share(walkers.count(1), len(walkers)), len(walkers)),
        ("walkers: none", "", _share(walkers.count(0), len(walkers)), len(walkers)),
        ("walkers: several", "", _share(sum(each > 1 for each in walkers), len(walkers)), len(walkers)),
        ("walkers: one id as long as in sight", "all", _share(whole, len(long)), len(long)),
        (
            "walkers: frames with the id that lives longest",
            "all",
            _share(longest, sum(len(s.ids) for s in long)),
            sum(len(s.ids) for s in long),
        ),
        ("leaving to the side: standing", "0", str(found.leaving_standing), found.leaving),
        ("leaving to the side: imminent", "0", str(found.leaving_imminent), found.leaving),
        ("objects on nothing", "", _share(found.on_nothing, found.objects), found.objects),
        ("objects on nothing: imminent", "", str(found.on_nothing_imminent), found.on_nothing),
    ]
    return Table("Goals", ("", "goal", "found", "of"), [(a, b, c, str(d)) for a, b, c, d in rows])


def _within(pairs: Iterable[Pair], quantity: str, most: float) -> int:
    return sum(abs(pair.error(quantity)) <= most for pair in pairs)


def _grouped(found: Calibration, by: str) -> dict[str, list[Pair]]:
    """Return the pairs by their true class or range; no group is empty."""
    groups: dict[str, list[Pair]] = {}
    if by == "class":
        for each in ObjectClass:
            groups[each.name.lower()] = [pair for pair in found.pairs if pair.body.class_id == each]
    else:
        for low, high in pairwise(_BANDS_M):
            groups[f"{low:g} to {high:g} m"] = [pair for pair in found.pairs if low <= pair.body.range_m < high]
    return {name: pairs for name, pairs in groups.items() if pairs}


def _errors(found: Calibration, by: str) -> Table:
    """Median and 90 % of the absolute errors; an infinite one is a contact that the object denies."""
    rows = []
    for name, pairs in _grouped(found, by).items():
        cells = []
        for quantity in ("ttc", "range", "lateral", "v_forward", "v_right"):
            chosen = [pair for pair in pairs if pair.near] if quantity in ("ttc", "lateral") else pairs
            errors = [abs(pair.error(quantity)) for pair in chosen]
            errors = [error for error in errors if not math.isnan(error)]
            middle, most = np.quantile(errors, (0.5, 0.9), method="lower").tolist() if errors else (math.nan, math.nan)
            cells.append(f"{number(middle, 2)} / {number(most, 2)}")
        rows.append((name, str(len(pairs)), *cells))
    heads = (by, "objects", "contact < 4 s, share", "range, share", "lateral < 4 s, m", "forward, m/s", "right, m/s")
    return Table(f"Errors by true {by}, median / 90 %", heads, rows)


def _sigmas_off(pairs: Iterable[Pair], quantity: str) -> npt.NDArray[np.float64]:
    """Errors over their sigmas, of the pairs that have both a truth and a number."""
    off = np.array([pair.sigmas_off(quantity) for pair in pairs if pair.known(quantity)], dtype=np.float64)
    return off[np.isfinite(off)]


def _inside(off: npt.NDArray[np.float64], most: float) -> str:
    return _share(int(np.count_nonzero(np.abs(off) <= most)), len(off))


def _sigmas(found: Calibration) -> Table:
    """Shares of the true values within so many sigmas; the median of error over sigma shows a bias.

    Where an object denies a contact, or does not know a number, there is no sigma to judge: those are counted apart.
    """
    rows = []
    for quantity in _QUANTITIES:
        off = _sigmas_off(found.pairs, quantity)
        known = sum(pair.known(quantity) for pair in found.pairs)
        bias = number(float(np.median(off)) if len(off) else math.nan, 2)
        rows.append(
            (quantity, _inside(off, 1), _inside(off, 2), bias, str(len(off)), _share(known - len(off), known)),
        )
    return Table(
        "Truths inside (goals: one sigma 60 to 75 %, two 90 to 97 %)",
        ("", "1 sigma", "2 sigma", "bias, sigma", "of", "no number"),
        rows,
    )


def _sigmas_by(found: Calibration, by: str) -> Table:
    """Shares of the true values within one and two sigmas."""
    rows = []
    for name, pairs in _grouped(found, by).items():
        offs = [_sigmas_off(pairs, quantity) for quantity in _SPLIT]
        rows.append((name, *(f"{_inside(off, 1)}, {_inside(off, 2)} of {len(off)}" for off in offs)))
    return Table(f"Truths inside one and two sigmas, by true {by}", (by, *_SPLIT), rows)


def _classes(found: Calibration) -> Table:
    rows = []
    for true in ObjectClass:
        given = [pair.class_id for pair in found.pairs if pair.body.class_id == true]
        if given:
            rows.append(
                (true.name.lower(), *(_share(given.count(each), len(given)) for each in ObjectClass), str(len(given)))
            )
    return Table("Classes: true (row) and said", ("", *(each.name.lower() for each in ObjectClass), "of"), rows)


def _chances(found: Calibration) -> Table:
    said = np.array([pair.probability for pair in found.pairs])
    true = np.array([pair.body.threat for pair in found.pairs], dtype=bool)
    rows = []
    for low, high in ((0.0, 0.05), (0.05, 0.3), (0.3, 0.7), (0.7, 0.95), (0.95, 1.01)):
        inside = (said >= low) & (said < high)
        count = int(np.count_nonzero(inside))
        rows.append(
            (
                f"{low:g} to {min(high, 1):g}",
                _share(float(said[inside].sum()), count),
                _share(int(np.count_nonzero(true & inside)), count),
                str(count),
            )
        )
    return Table("Probability of being met: said and true", ("", "mean", "met", "of"), rows)


# Drives.


class _Onlooker:
    """The planner with ground truth drives, the pipeline observes."""

    def __init__(self, world: World, found: Calibration, of: str) -> None:
        self._reported = reported_objects(world, of)
        self._driver, self._method = TruthDriver(world), method_of(world, FILTER)
        self._world, self._found = world, found

    def decide(self, moment: Moment) -> float:
        """The speed to drive at now, m/s."""
        for sample in moment.samples:
            self._method.add(sample)
        assert moment.frame is not None
        scene: Scene = self._method.process(moment.frame)
        name = f"world {self._world.seed}"
        self._found.see(name, moment.time_s, self._reported(scene), moment.known, self._world.build.half_width_m)
        return self._driver.decide(moment)


def look_on(seeds: Iterable[int], found: Calibration, of: str = OBJECTS) -> Iterator[str]:
    """Run worlds of the closed loop; yields the name of each that is done."""
    for seed in seeds:
        world = worlds.make(seed)
        drive(world, _Onlooker(world, found, of))
        yield f"world {seed}"


def play(kinds: Iterable[str], seeds: Sequence[int], found: Calibration, of: str = OBJECTS) -> Iterator[str]:
    """Play rendered drives; yields the name of each that is done."""
    for kind in kinds:
        for seed in seeds:
            spec = scenes.make(kind, seed)
            stage = Stage(spec)
            for moment in play_drive(spec, config_of(spec), [FILTER]):
                time_s = moment.frame.seq / spec.fps
                known = exact_of_drive(stage, stage.view(time_s))
                scene = moment.scenes[FILTER]
                objects = scene.objects if of == OBJECTS else objects_of_circles(scene, spec)
                found.see(f"{kind} {seed}", time_s, objects, known, spec.half_width_m)
            yield f"{kind} {seed}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables, and write them to ``benchmarks/results``."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calibration", description=__doc__)
    parser.add_argument("--worlds", type=int, default=8, help="of the closed loop (default 8)")
    parser.add_argument("--seed", type=int, default=0, help="of the first of them (default 0)")
    parser.add_argument("--kinds", default="", help="of rendered drives besides, with commas, or all")
    parser.add_argument("--drives", type=int, default=2, help="of each kind (default 2)")
    parser.add_argument("--of", choices=(OBJECTS, CIRCLES), default=OBJECTS, help="circles: one object for each")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    kinds = scenes.KINDS if options.kinds == "all" else tuple(filter(None, options.kinds.split(",")))
    found = Calibration()
    seeds = range(options.seed, options.seed + options.worlds)
    steps = [
        *([look_on(seeds, found, options.of)] if options.worlds else []),
        play(kinds, range(options.drives), found, options.of),
    ]
    with tqdm(total=options.worlds + len(kinds) * options.drives, disable=None, file=sys.stderr, ncols=80) as bar:
        for each in steps:
            for done in each:
                bar.update()
                bar.set_postfix_str(done)
    played = [f"worlds {seeds[0]} to {seeds[-1]}"] if seeds else []
    if kinds:
        played.append(f"{counted(options.drives, 'rendered drive')} of each of {counted(len(kinds), 'kind')}")
    title = f"Calibration of {options.of}: {', and '.join(played) or 'nothing'}"
    name = "calibration" if options.of == OBJECTS else f"calibration_{options.of}"
    data = {"of": options.of, "worlds": list(seeds), "kinds": kinds, "drives": options.drives}
    written = tables(found)
    sys.stdout.write(report.write(name, title, written, {**data, "tables": written}) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
