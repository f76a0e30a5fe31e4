"""What an object's motion in the image says about its range and its motion over ground, and how sure that is.

Three numbers are measured: the looming m = (V - w_z)/Z, 1/s; the sideways rate q = w_x/Z, 1/s, what is left of the
motion to the side when the looming is taken out; and the inverse range 1/Z of the ground under its lowest edge. Here V
is the vehicle's speed and (w_x, w_z) the object's velocity over ground, to the right and forward. One camera cannot
tell a slow thing that is near from a fast one that is far; so the belief is kept over a grid of ranges, for two cases:
it *stands* (w = 0: m = V/Z and q = 0), or it *moves* (w is normal with ``σ_w``). Each pair of case and range is
weighed by how well it explains what was measured; all that is reported of an object is a mean over the pairs, with its
standard deviation. Somebody who walks away to the side does not loom: nothing that stands near explains him.
"""

import math

from lcf_edge.filter import lengths, path
from lcf_edge.filter.memory import doubles
from lcf_edge.filter.situation import Situation

RANGES = 48  # of the grid, in equal ratios
NEAREST_M = 0.3
FARTHEST_REACHES = 6.0  # in ways of the vehicle within the horizon
FARTHEST_M = 25.0  # at least
WALKS_MPS = 1.2  # σ_w at rest: who walks or cycles beside a slow vehicle,
TRAFFIC_SHARE = 0.5  # and what drives beside a fast one
CHANGES_MPS = 0.08  # 1 sigma of how much a mover's velocity changes while it is measured
FOOT_SHARE = 0.08  # of the inverse range, 1 sigma by which an object's lowest edge lies beside its foot,
HIDDEN_FOOT = 0.25  # if that is seen at all; else, which is so likely,
LIFTED_M = 0.5  # so far, 1 sigma
SMALL_M = 0.2  # what is smaller than this is hardly met,
SMALL_RATIO = 0.5  # by the logarithm, 1 sigma
SUNK_FOOT = 1e-9  # likelihood of what lies deep under the ground
MEMORY_SHARE = 0.3  # share of a range, 1 sigma of what is kept of it from frame to frame, at least:
# successive frames tell much the same, and it must not be counted as often
JUMPS_HZ = 0.1  # how often it was wrong
ODDS = 1.4  # logarithmic odds that a thing stands, before anything is measured
ALONG_MPS = 0.2  # σ of the motion to the side of what goes along the path,
ALONG = 0.5  # which is this share of what moves
SPEED_SHARE = 0.05  # 1 sigma of the vehicle's speed
MIN_SIGMA_HZ = 0.003  # of a looming or a sideways rate: what no model of noise has
MAX_HORIZONS = 3.0  # later contacts do not count in a mean
FRONT_SHARE = 0.3  # of half an object's width, by which its front is nearer than the mean of its edges,
MAX_HALF_WIDTH = 1.0  # of an object, as a share of its range, that counts there: a wider box holds more than one thing
DEPTH_SHARE = 0.4  # and 1 sigma of that,
MIN_DEPTH = 0.03  # more by this share of its range
MIN_WEIGHT = 0.2  # of all pairs of case and range, that a mean needs
WIDER = 1.15  # than the spread of the pairs is what may be: both cases are simpler than the world
MIN_SHARE = 1e-5  # pairs with less are left out
RANGE, FORWARD, RIGHT, RATE, LATERAL, CLOSEST, QUANTITIES = 0, 1, 2, 3, 4, 5, 6
TINY = 1e-300
ROOT_2 = math.sqrt(2.0)
INFINITY = float("inf")
NAN = float("nan")


class Evidence:
    """What was measured of one object, and what is believed before.

    ``looming`` m, ``sideways`` q, 1/s, their variances and covariance ``mm``, ``qq``, ``mq``; ``reference``, m/s, the
    vehicle's speed at which they were measured, which may be another one now; ``across``, tan of the bearing from O;
    ``across_sigma``; ``half_width``, tan of half its width; ``half_extent``, of half its width or height, whichever is
    more; ``foot`` 1/Z of the ground under it, 1/m, with
    ``foot_sigma``; ``hidden``: the probability that it shows no edge; ``is_cut``: it is below the image; ``log_odds``
    of standing and ``range_before``, m, NaN: none, with ``range_doubt``, 1 sigma of its logarithm, as they were
    believed in the frame before, brought to now.
    """

    def __init__(self) -> None:
        self.looming = self.sideways = self.mm = self.qq = self.mq = 0.0
        self.reference = self.across = self.across_sigma = self.half_width = self.half_extent = 0.0
        self.foot = self.foot_sigma = self.log_odds = 0.0
        self.hidden, self.is_cut = HIDDEN_FOOT, False
        self.range_before = self.range_doubt = NAN


class Belief:
    """What is believed after.

    ``stands``: the probability that it stands, and ``log_odds``, its logarithmic odds; ``met``: the probability that it
    is met within the horizon; ``middle``, m, the range of the middle of its edges, with ``middle_sigma``, 1 sigma of
    its logarithm; ``mean`` and ``sigma`` (QUANTITIES,), NaN where nothing is known: ``RANGE`` m, of its front,
    ``FORWARD`` and ``RIGHT`` m/s over ground, ``RATE`` 1/s, the inverse time to contact, ``LATERAL`` m, how far beside
    the path it is when it is passed, ``CLOSEST`` s until it is passed.

    ``inverse``: (RANGES,) the grid, 1/m; ``standing``, ``moving``: weights of its ranges, 1 in all; ``inner_…``: the
    motion supposed for one of them.
    """

    def __init__(self) -> None:
        self.stands = self.log_odds = self.met = 0.0
        self.middle = self.middle_sigma = NAN
        self.weight, self.mean, self.sigma = [doubles(QUANTITIES) for _ in range(3)]
        self.inverse, self.standing, self.moving = [doubles(RANGES) for _ in range(3)]
        self.inner_forward = self.inner_right = self.inner_forward_var = self.inner_right_var = 0.0
        self.inner_rate = self.inner_rate_var = 0.0


def log_normal2(dm: float, dq: float, mm: float, qq: float, mq: float) -> float:
    """Logarithm of a normal density of two variables, without its constant."""
    determinant = max(mm * qq - mq * mq, 1e-18)
    distance = (dm * dm * qq - 2 * dm * dq * mq + dq * dq * mm) / determinant
    return -0.5 * (distance + math.log(determinant))


def foot_likelihood(evidence: Evidence, inverse: float, around: Situation) -> float:
    """How well an inverse range agrees with where the lowest edge is seen, as a density of the latter.

    Nothing is below the ground: what is seen there is no farther than the ground. It may be nearer, as its lowest edge
    may lie above its foot: a little, or, where the foot shows no edge, by ``LIFTED_M``.
    """
    apart = inverse - evidence.foot
    sigma = evidence.foot_sigma + FOOT_SHARE * inverse
    lifted = LIFTED_M * inverse / around.camera_height_m
    if apart < 0:
        ratio = apart / sigma
        sunk = max(math.exp(-0.5 * ratio * ratio), SUNK_FOOT)
        return sunk if evidence.is_cut else sunk * ((1 - evidence.hidden) / sigma + evidence.hidden / lifted)
    if evidence.is_cut:
        return 1.0
    near, far = apart / sigma, apart / lifted
    return (1 - evidence.hidden) / sigma * math.exp(-0.5 * near * near) + evidence.hidden / lifted * math.exp(
        -0.5 * far * far
    )


def memory_likelihood(evidence: Evidence, inverse: float, around: Situation) -> float:
    """How well an inverse range agrees with the range before: a thing does not jump, but the belief was unsure."""
    if not evidence.range_before > 0:
        return 1.0
    sigma = max(evidence.range_doubt, MEMORY_SHARE)
    apart = math.log(inverse * evidence.range_before) / sigma
    return JUMPS_HZ * around.dt_s + math.exp(-0.5 * apart * apart) / sigma


def small_log(evidence: Evidence, inverse: float) -> float:
    """Logarithm of how likely a thing is that would be as small as this one is at an inverse range."""
    small = math.log(max(2 * evidence.half_extent / (SMALL_M * inverse), TINY)) / SMALL_RATIO
    return -0.5 * small * small if small < 0 else 0.0


def walking_mps(around: Situation) -> float:
    """σ_w, m/s: how fast movers are."""
    return WALKS_MPS + TRAFFIC_SHARE * math.fabs(around.speed_mps)


def weigh(belief: Belief, evidence: Evidence, around: Situation) -> None:
    """The weight of each pair of case and range."""
    farthest_m = max(FARTHEST_REACHES * math.fabs(around.speed_mps) * around.horizon_s, FARTHEST_M)
    ratio = math.pow(NEAREST_M / farthest_m, 1.0 / (RANGES - 1))
    inverse = 1 / NEAREST_M
    walks = walking_mps(around)
    most = -INFINITY
    for k in range(RANGES):
        belief.inverse[k] = inverse
        place = math.log(memory_likelihood(evidence, inverse, around)) + small_log(evidence, inverse)
        if around.camera_height_m > 0:
            place += math.log(foot_likelihood(evidence, inverse, around))
        dm = evidence.looming - inverse * evidence.reference
        wrong = SPEED_SHARE * inverse * evidence.reference
        floor = MIN_SIGMA_HZ * MIN_SIGMA_HZ
        mm, qq = evidence.mm + wrong * wrong + floor, evidence.qq + floor
        belief.standing[k] = place + ODDS + evidence.log_odds + log_normal2(dm, evidence.sideways, mm, qq, evidence.mq)
        free, along = inverse * walks, inverse * ALONG_MPS
        mm += free * free
        free_log = log_normal2(dm, evidence.sideways, mm, qq + free * free, evidence.mq)
        along_log = log_normal2(dm, evidence.sideways, mm, qq + along * along, evidence.mq)
        belief.moving[k] = place + math.log((1 - ALONG) * math.exp(free_log) + ALONG * math.exp(along_log) + TINY)
        most = max(most, belief.standing[k], belief.moving[k])
        inverse *= ratio
    stands = moves = 0.0
    for k in range(RANGES):
        belief.standing[k], belief.moving[k] = math.exp(belief.standing[k] - most), math.exp(belief.moving[k] - most)
        stands += belief.standing[k]
        moves += belief.moving[k]
    total = stands + moves
    for k in range(RANGES):
        belief.standing[k] /= total
        belief.moving[k] /= total
    belief.stands = stands / total
    belief.log_odds = math.log(max(stands, 1e-12)) - math.log(max(moves, 1e-12))


def suppose_standing(belief: Belief, inverse: float, around: Situation) -> None:
    """Its motion, if it stands at a range."""
    belief.inner_forward = belief.inner_right = belief.inner_forward_var = belief.inner_right_var = 0.0
    belief.inner_rate = inverse * around.speed_mps
    wrong = SPEED_SHARE * belief.inner_rate
    belief.inner_rate_var = wrong * wrong


def suppose_moving(belief: Belief, evidence: Evidence, inverse: float, around: Situation) -> None:
    """Its motion, if it moves at a range: what was measured, drawn towards rest as far as it is unsure."""
    walks = walking_mps(around)
    range2 = 1 / (inverse * inverse)
    forward_var, right_var = evidence.mm * range2, evidence.qq * range2
    forward_share = walks * walks / (walks * walks + forward_var)
    right_share = walks * walks / (walks * walks + right_var)
    belief.inner_forward = forward_share * (evidence.reference - evidence.looming / inverse)
    belief.inner_right = right_share * evidence.sideways / inverse
    changed = CHANGES_MPS * CHANGES_MPS
    belief.inner_forward_var = forward_share * forward_var + changed
    belief.inner_right_var = right_share * right_var + changed
    belief.inner_rate = inverse * (around.speed_mps - belief.inner_forward)
    belief.inner_rate_var = inverse * inverse * belief.inner_forward_var


def lateral_at(belief: Belief, evidence: Evidence, inverse: float, around: Situation) -> float:
    """m beside the vehicle's path when a supposed object is passed, right positive."""
    time_s = 1 / belief.inner_rate
    right_m = evidence.across / inverse + belief.inner_right * time_s
    ahead_m = 1 / inverse + belief.inner_forward * time_s
    return path.miss(right_m, ahead_m, around)


def lateral_var(belief: Belief, evidence: Evidence, inverse: float) -> float:
    """Its variance, m²: by the motion to the side, and by the time over which it lasts."""
    time_s = 1 / belief.inner_rate
    late_s2 = belief.inner_rate_var * time_s * time_s * time_s * time_s
    aside = evidence.across_sigma / inverse
    return time_s * time_s * belief.inner_right_var + belief.inner_right * belief.inner_right * late_s2 + aside * aside


def below(value: float, mean: float, variance: float) -> float:
    """Probability that a normal variable is below a value."""
    return 0.5 * (1 + math.erf((value - mean) / (ROOT_2 * math.sqrt(max(variance, 1e-12)))))


def met_probability(belief: Belief, evidence: Evidence, inverse: float, around: Situation) -> float:
    """Probability that a supposed object is met: inside the half widths, within the horizon."""
    half_m = around.half_width_m + evidence.half_width / inverse
    lateral, variance = lateral_at(belief, evidence, inverse, around), lateral_var(belief, evidence, inverse)
    beside = below(half_m, lateral, variance) - below(-half_m, lateral, variance)
    soon = 1 - below(1 / around.horizon_s, belief.inner_rate, belief.inner_rate_var)
    return beside * soon


def take(belief: Belief, quantity: int, weight: float, value: float, variance: float) -> None:
    """Take a value into the mean of a quantity, with its variance."""
    belief.weight[quantity] += weight
    belief.mean[quantity] += weight * value
    belief.sigma[quantity] += weight * (value * value + variance)


def suppose(belief: Belief, weight: float, evidence: Evidence, inverse: float, around: Situation) -> None:
    """Take one pair of case and range into all means, by its weight."""
    take(belief, RANGE, weight, -math.log(inverse), 0.0)
    take(belief, FORWARD, weight, belief.inner_forward, belief.inner_forward_var)
    take(belief, RIGHT, weight, belief.inner_right, belief.inner_right_var)
    take(belief, RATE, weight, belief.inner_rate, belief.inner_rate_var)
    if belief.inner_rate * MAX_HORIZONS * around.horizon_s > 1:
        time_s, lateral_m = 1 / belief.inner_rate, lateral_at(belief, evidence, inverse, around)
        take(belief, CLOSEST, weight, time_s, belief.inner_rate_var * time_s * time_s * time_s * time_s)
        take(belief, LATERAL, weight, lateral_m, lateral_var(belief, evidence, inverse))
        belief.met += weight * met_probability(belief, evidence, inverse, around)


def conclude(belief: Belief) -> None:
    """The means and standard deviations of what was taken; NaN where hardly anything was."""
    for quantity in range(QUANTITIES):
        weight = belief.weight[quantity]
        if weight < MIN_WEIGHT:
            belief.mean[quantity] = belief.sigma[quantity] = NAN
        else:
            mean = belief.mean[quantity] / weight
            belief.mean[quantity] = mean
            belief.sigma[quantity] = WIDER * math.sqrt(max(belief.sigma[quantity] / weight - mean * mean, 0.0))


def set_front(belief: Belief, evidence: Evidence) -> None:
    """Contact is with the front of an object, its edges lie on its sides too: by a share of its width behind it.

    Of the range the mean of the logarithm was taken.
    """
    half_width = min(evidence.half_width, MAX_HALF_WIDTH)
    nearer = 1 - FRONT_SHARE * half_width
    deep = DEPTH_SHARE * half_width + MIN_DEPTH
    belief.middle, belief.middle_sigma = math.exp(belief.mean[RANGE]), belief.sigma[RANGE]
    range_m = belief.middle * nearer
    belief.sigma[RANGE] = range_m * lengths.of(belief.sigma[RANGE], deep)
    belief.mean[RANGE] = range_m
    belief.mean[RATE] /= nearer
    belief.sigma[RATE] = lengths.of(belief.sigma[RATE], deep * belief.mean[RATE])
    belief.mean[CLOSEST] *= nearer
    belief.sigma[CLOSEST] = lengths.of(belief.sigma[CLOSEST], deep * belief.mean[CLOSEST])


def consider(belief: Belief, evidence: Evidence, around: Situation) -> None:
    """All that is believed of an object, by what was measured; the vehicle's speed must be known."""
    weigh(belief, evidence, around)
    belief.met = 0.0
    for quantity in range(QUANTITIES):
        belief.weight[quantity] = belief.mean[quantity] = belief.sigma[quantity] = 0.0
    for k in range(RANGES):
        inverse = belief.inverse[k]
        if belief.standing[k] > MIN_SHARE:
            suppose_standing(belief, inverse, around)
            suppose(belief, belief.standing[k], evidence, inverse, around)
        if belief.moving[k] > MIN_SHARE:
            suppose_moving(belief, evidence, inverse, around)
            suppose(belief, belief.moving[k], evidence, inverse, around)
    conclude(belief)
    set_front(belief, evidence)
