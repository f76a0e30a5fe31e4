"""Worlds from seeds: a course, events along it, stationary bodies beside it, and faults of the vehicle."""

import math
import zlib
from dataclasses import replace
from typing import Any

import numpy as np

from hil_mocks.closed_loop.course import Course
from hil_mocks.closed_loop.draft import Draft
from hil_mocks.closed_loop.events import BLOCKED, EVENTS
from hil_mocks.closed_loop.vehicle import Build
from hil_mocks.closed_loop.world import Body, World
from lcf_edge.rendered.drives import Axis, Lens, Paint, Profile, SensorNoise, Shake

CRUISES_MPS = ((0.3, 0.7), (0.7, 1.3), (1.3, 2.2), (2.2, 4.0))
CONDITIONS = ("fair", "fair", "vibration", "dusk", "gyro bias", "no gyro", "no speed")
COURSES = ("straight", "straight", "arc", "slalom", "bend")
_LOOKS = 6  # textures of ground and sky: making them takes longer than a drive
_SECONDS = 15.0  # of a drive at its cruise speed
_EVENT_S = 4.0  # from one event to the next
_FIRST_S = 3.0
_TURN_RADPS, _ASIDE_MPS2 = 0.35, 1.0  # most yaw rate and side acceleration
_BESIDE_M = 0.35  # distance of bodies beside the course from the vehicle's flank


def make(seed: int, **changes: Any) -> World:
    """The world of a seed; `changes` replace fields of it. Raises ValueError on a negative seed."""
    if seed < 0:
        raise ValueError("a world needs a seed >= 0")
    random = np.random.default_rng([seed, zlib.crc32(b"closed loop")])
    cruise = float(random.uniform(*CRUISES_MPS[seed % len(CRUISES_MPS)]))
    condition = CONDITIONS[int(random.integers(len(CONDITIONS)))]
    small = cruise < CRUISES_MPS[0][1]
    half_width = float(random.uniform(0.2, 0.3) if small else random.uniform(0.3, 0.6))
    build = Build(
        "bicycle" if random.random() < 0.5 else "differential",
        half_width,
        2.4 * half_width,
        1.6 * half_width,
        delay_s=float(random.uniform(0.1, 0.2)),
    )
    draft = Draft(random, _course(random, cruise), cruise, build)
    end_m = draft.course.length_m
    places = np.arange(_FIRST_S, _SECONDS - 2.0, _EVENT_S) * cruise
    for at_m in places.tolist():
        event = list(EVENTS)[int(random.integers(len(EVENTS)))]
        EVENTS[event](draft, at_m + 1.0)
        draft.events.append(event)
    if random.random() < 0.4:
        draft.events.append(BLOCKED)
        size = draft.between(0.5, 1.3), draft.between(0.5, 1.8), 0.6
        at_m = end_m + 0.3
        x, z = draft.course.place(at_m, draft.between(-0.2, 0.2))
        draft.bodies.append(
            Body(f"blocker_{len(draft.bodies)}", *size, x, z, draft.course.heading(at_m), draft.paint(0.2))
        )
    _clutter(draft)
    return replace(_dressed(draft, seed, condition), **changes)


def _course(random: np.random.Generator, cruise_mps: float) -> Course:
    length = _SECONDS * cruise_mps
    kind = COURSES[int(random.integers(len(COURSES)))]
    side = int(random.choice((-1, 1)))
    most = side * min(_ASIDE_MPS2 / cruise_mps**2, _TURN_RADPS / cruise_mps, 0.3) * float(random.uniform(0.4, 1.0))
    knots: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    if kind == "arc":
        knots = ((0.0, 0.0), (0.15 * length, 0.0), (0.25 * length, most), (length, most))
    elif kind == "bend":
        knots = ((0.35 * length, 0.0), (0.45 * length, most), (0.65 * length, most), (0.75 * length, 0.0))
    elif kind == "slalom":
        waves = np.linspace(0, length, 41)
        knots = tuple(zip(waves.tolist(), (most * np.sin(waves / length * 3 * math.tau)).tolist(), strict=True))
    return Course(length, knots)


def _clutter(draft: Draft) -> None:
    """Bodies beside the course, sparser where it is fast."""
    gaps = (0.9, 2.2) if draft.cruise_mps < CRUISES_MPS[2][0] else (2.0, 4.5)
    for side in (-1, 1):
        at_m = draft.between(0.5, 2.0)
        while at_m < draft.course.length_m + 14.0:
            size = draft.between(0.3, 1.0), draft.between(0.35, 1.8), draft.between(0.3, 1.0)
            reach = math.hypot(size[0], size[2]) / 2
            right_m = side * (draft.beside(_BESIDE_M + draft.between(0.0, 2.2)) + reach)
            x, z = draft.course.place(at_m, right_m)
            if draft.course.clearance(np.array([x, z])) > draft.beside(_BESIDE_M) + reach - 0.02:
                draft.stand("clutter", at_m, right_m, size, draft.between(-0.5, 0.5))
            at_m += size[2] + draft.between(*gaps)


def _dressed(draft: Draft, seed: int, condition: str) -> World:
    """The world with its textures, and with faults of sensors and light."""
    random = draft.random
    bias = random.normal(0, 0.03 if condition == "gyro bias" else 0.004, 3).tolist()
    noise = SensorNoise(
        tuple(bias),
        accel_bias_mps2=tuple(random.normal(0, 0.1, 3).tolist()),
        speed_scale=float(random.normal(1, 0.015)),
        image=4.0 if condition == "dusk" else 2.0,
    )
    gain = Profile(((0.0, 1.0),))
    if condition == "dusk":
        low, jump = draft.between(0.4, 0.55), draft.between(3.0, 9.0)
        gain = Profile(((0.0, low), (jump, low * 0.85), (jump + 0.05, low * 1.5), (_SECONDS, low * 1.3)))
    waits: tuple[tuple[float, float], ...] = ()
    if random.random() < 0.2:
        waits = ((draft.course.length_m * draft.between(0.2, 0.7), draft.between(0.8, 2.0)),)
    look = int(random.integers(_LOOKS))
    looks = np.random.default_rng([look, 5])
    return World(
        seed,
        tuple(draft.events),
        condition,
        draft.course,
        draft.cruise_mps,
        draft.build,
        tuple(draft.bodies),
        blocked=BLOCKED in draft.events,
        start_mps=0.0 if random.random() < 0.5 else draft.cruise_mps,
        waits_m=waits,
        camera_height_m=0.3 if draft.build.half_width_m < 0.3 else 0.5,
        camera_pitch_rad=draft.between(-0.02, 0.02),
        lens=Lens(vignetting=draft.between(0.0, 0.3)),
        noise=noise,
        shakes=_shakes(random, draft.between(0.6, 1.2) if condition == "vibration" else draft.between(0.03, 0.15)),
        gyro=condition != "no gyro",
        odometry=condition != "no speed",
        track_m=1.8 * draft.build.half_width_m,
        gain=gain,
        ground=Paint(1000 + look, feature_m=0.08, grey=float(looks.uniform(90, 120))),
        sky=Paint(2000 + look, feature_m=0.1, grey=150.0),
    )


def _shakes(random: np.random.Generator, degrees: float) -> tuple[Shake, ...]:
    axes: tuple[tuple[Axis, float], ...] = (("pitch", 1.0), ("roll", 0.6), ("yaw", 0.5))
    shakes = [
        Shake(
            axis, math.radians(degrees) * share * random.uniform(0.3, 0.7), *random.uniform((3, 0), (15, 6.28)).tolist()
        )
        for axis, share in axes
        for _ in range(2)
    ]
    return (*shakes, Shake("heave", 0.002 * degrees, *random.uniform((3, 0), (12, 6.28)).tolist()))
