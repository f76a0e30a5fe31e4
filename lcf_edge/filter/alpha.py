"""α: chains of three key positions become rebel edges; rebels that obey the flow again return to E_n."""

import math

from lcf_edge.filter import flow, key_frames, rebel_detection
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.inputs import KEYS
from lcf_edge.filter.key_frames import KeyFrames
from lcf_edge.filter.memory import Integers
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation

MIN_BASELINE_S = 0.08  # shorter histories are lost in noise
PENDING = 2  # links of a chain that waits for its third key frame
OBEYING_COSTS = 2.0  # trust that a rebel loses in each frame in which it follows the flow


def is_still(edges: EdgeColumns, over_s: float, motion_px: float) -> bool:
    """Whether the median edge moved less than ``motion_px`` in ``over_s``."""
    slow = 0
    for i in range(edges.count):
        if math.fabs(edges.speed[i]) * over_s < motion_px:
            slow += 1
    return slow > edges.count // 2


def key_is_due(edges: EdgeColumns, keys: KeyFrames, dt_s: float, settings: Settings) -> bool:
    """Whether motion since the last key frame exceeds corner noise, or the longest interval is over."""
    waited_s = keys.since_s + 0.5 * dt_s
    if keys.number == 0:
        return True
    if waited_s < settings.key_interval_s:
        return False
    if waited_s < 2 * settings.key_interval_s and edges.count > 0:
        return not is_still(edges, keys.since_s, settings.key_motion_px)
    return True


def mark_key(edges: EdgeColumns, keys: KeyFrames) -> None:
    """Make this frame a key frame: every edge stores its position. One held under ψ starts its history anew."""
    slot = key_frames.mark(keys)
    for i in range(edges.count):
        if edges.held[i]:
            edges.born_key[i] = keys.number
        edges.key_x[i, slot], edges.key_y[i, slot] = edges.x[i], edges.y[i]


def judge_all(
    verdicts: Verdicts,
    edges: EdgeColumns,
    keys: KeyFrames,
    baselines: Baselines,
    around: Situation,
    settings: Settings,
) -> None:
    """Judge every matched edge that has a history, over the whole of it."""
    verdicts.count = 0
    for i in range(edges.count):
        if edges.is_own_part(i):
            edges.rebel[i] = edges.suspect_keys[i] = 0  # it moves with the camera: no obstacle
        elif edges.matched[i] and key_frames.has_history(edges, i, keys, MIN_BASELINE_S):
            j = verdicts.count
            verdicts.count += 1
            verdicts.oldest[j] = key_frames.oldest_key(edges, i, keys)
            rebel_detection.link(verdicts, j, edges, i, verdicts.oldest[j] % KEYS, baselines)
            rebel_detection.judge(verdicts, j, edges, baselines, around)
    rebel_detection.judge_together(verdicts, edges, baselines, around, settings)


def breaks_flow(verdicts: Verdicts, j: int) -> bool:
    """Whether an edge moves independently, or is on a collision course."""
    return verdicts.mover[j] != 0 or verdicts.incoming[j] != 0


def outward_speed(edges: EdgeColumns, i: int, around: Situation) -> float:
    """V along its flow line of an edge that has been a rebel or chain, px/s."""
    beta = math.atan2(edges.y[i] - around.focus_y, edges.x[i] - around.focus_x)
    return edges.speed[i] * math.cos(flow.wrap(edges.beta[i] - beta))


def send_home(edges: EdgeColumns, i: int, around: Situation, settings: Settings) -> None:
    """A rebel becomes a normal edge."""
    edges.rebel[i] = 0
    edges.trust[i] = settings.tr_new
    edges.circle[i] = -1
    edges.speed[i] = outward_speed(edges, i, around)


def release_obedient(verdicts: Verdicts, edges: EdgeColumns, around: Situation, settings: Settings) -> None:
    """Edges that follow the flow again: rebels lose trust and return to E_n below Tr_cr, chains are released."""
    for j in range(verdicts.count):
        i = verdicts.row[j]
        if breaks_flow(verdicts, j):
            continue
        if edges.rebel[i]:
            edges.trust[i] -= OBEYING_COSTS
            if edges.trust[i] < settings.tr_cr:
                send_home(edges, i, around, settings)
        elif edges.suspect_keys[i] > 0:
            edges.suspect_keys[i] = 0
            edges.speed[i] = outward_speed(edges, i, around)


def wait(edges: EdgeColumns, i: int, key: bool, around: Situation) -> None:
    """Make an edge that breaks the flow a chain, to wait for its third key frame."""
    if edges.suspect_keys[i] == 0:  # until now it followed its flow line
        edges.beta[i] = math.atan2(edges.y[i] - around.focus_y, edges.x[i] - around.focus_x)
    suspect_keys = edges.suspect_keys[i] + (1 if key else 0)
    edges.suspect_keys[i] = min(max(suspect_keys, 1), PENDING)


def middle_key(verdicts: Verdicts, j: int, keys: KeyFrames, key: bool) -> int:
    """Number of the key frame halfway between a chain's oldest and now: the second of its three key positions."""
    return (verdicts.oldest[j] + keys.number - (1 if key else 0)) // 2


def decide(
    verdicts: Verdicts,
    recent: Verdicts,
    edges: EdgeColumns,
    keys: KeyFrames,
    key: bool,
    baselines: Baselines,
    born: Integers,
    around: Situation,
) -> int:
    """Decide each chain: if its younger link agrees with the whole it becomes a rebel. Either way the chain ends.

    ``born``: (capacity,) rows of ``verdicts`` that become rebels; returns how many. ``recent``: scratch for the verdict
    on the younger link. ``key``: whether this frame is a key frame.
    """
    births = 0
    for j in range(verdicts.count):
        i = verdicts.row[j]
        if edges.rebel[i] or not breaks_flow(verdicts, j):
            continue
        middle = middle_key(verdicts, j, keys, key)
        if middle <= verdicts.oldest[j]:
            wait(edges, i, key, around)
            continue
        rebel_detection.link(recent, 0, edges, i, middle % KEYS, baselines)
        rebel_detection.judge(recent, 0, edges, baselines, around)
        if rebel_detection.agree(verdicts, j, recent, 0, baselines):
            born[births] = j
            births += 1
            continue
        edges.suspect_keys[i] = 0
        if verdicts.mover[j] and not verdicts.together[j]:  # not one landmark: discard its history
            edges.born_key[i] = keys.number
    return births


def give_births(
    verdicts: Verdicts,
    recent: Verdicts,
    edges: EdgeColumns,
    keys: KeyFrames,
    key: bool,
    baselines: Baselines,
    born: Integers,
    births: int,
    settings: Settings,
) -> None:
    """The first ``births`` of ``born`` become rebels."""
    for b in range(births):
        j = born[b]
        slot = middle_key(verdicts, j, keys, key) % KEYS
        rebel_detection.link(recent, 0, edges, verdicts.row[j], slot, baselines)
        rebel_detection.give_birth(edges, verdicts, j, recent, 0, baselines.elapsed_s[slot], settings)


def gather_rebels(verdicts: Verdicts, edges: EdgeColumns, breaking: Integers) -> int:
    """Gather the rebels that break the flow in this frame; their O slides with the window of key frames.

    ``breaking``: (capacity,) their rows of ``verdicts``; returns how many.
    """
    rebels = 0
    for j in range(verdicts.count):
        i = verdicts.row[j]
        if edges.rebel[i] and breaks_flow(verdicts, j):
            edges.origin_x[i], edges.origin_y[i] = verdicts.x[j], verdicts.y[j]
            breaking[rebels] = j
            rebels += 1
    return rebels
