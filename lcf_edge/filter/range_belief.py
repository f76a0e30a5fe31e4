"""Estimates an object's range and motion over ground, with their uncertainty, from its motion in the image.

Three quantities are measured: the looming m = (V - w_z)/Z, 1/s; the sideways rate q = w_x/Z, 1/s, the sideways motion
that remains without looming; and the inverse range 1/Z of the ground under its lowest edge. V is the vehicle's speed,
(w_x, w_z) the object's velocity over ground, right and forward. One camera cannot distinguish slow and near from fast
and far, so the belief is a grid of ranges for two cases: the object *stands* (w = 0: m = V/Z and q = 0), or it *moves*
(w is normal with ``σ_w``). Each pair of case and range is weighted by its likelihood; everything reported is a mean
over the pairs, with its standard deviation. Somebody who walks off sideways does not loom, as nothing stationary and
near would explain.
"""

import math

from lcf_edge.filter import lengths, path
from lcf_edge.filter.memory import doubles
from lcf_edge.filter.situation import Situation

RANGES = 48  # of the grid, spaced logarithmically
NEAREST_M = 0.3
FARTHEST_REACHES = 6.0  # in distances that the vehicle drives within the horizon,
FARTHEST_M = 25.0  # or this, if more
WALKS_MPS = 1.2  # σ_w for a vehicle at rest: pedestrians and cyclists,
TRAFFIC_SHARE = 0.5  # plus this share of its speed: traffic
CHANGES_MPS = 0.08  # 1 sigma of the change of a mover's velocity while it is measured
FOOT_SHARE = 0.08  # 1 sigma of the lowest edge about the foot, as a share of 1/Z, where the foot shows;
HIDDEN_FOOT = 0.25  # probability that it shows no edge; then the lowest edge is higher
LIFTED_M = 0.5  # by this, 1 sigma
MAX_GROUNDS = 16  # edges of the ground beneath it that count
SEEN_BENEATH = 0.5  # likelihood of each of those that it would hide: legs, overhang,
LEAST_SEEN = 1e-3  # and of all, at least
SMALL_M = 0.2  # smaller things are unlikely,
SMALL_RATIO = 0.5  # 1 sigma of ln(size) below that
SUNK_FOOT = 1e-9  # likelihood of a foot deep under the ground
MEMORY_SHARE = 0.3  # least 1 sigma of ln(range) that is kept from frame to frame:
# successive frames are not independent
JUMPS_HZ = 0.1  # rate at which the belief turns out wrong
ODDS = 1.4  # prior log odds that an object stands
ALONG_MPS = 0.2  # σ of the sideways motion of movers along the path,
ALONG = 0.4  # which are this share of movers
SLOW_MPS = 0.5  # σ_w of those who walk slowly,
SLOW = 0.45  # which are this share
SPEED_SHARE = 0.05  # 1 sigma of the vehicle's speed, as a share
STANDS_SHARE = 0.5  # 1 sigma of V/Z of what seems to stand, as a share
MIN_SIGMA_HZ = 0.003  # noise floor of looming and sideways rate
MAX_HORIZONS = 3.0  # later contacts do not enter the means
FRONT_SHARE = 0.1  # distance of the front before the mean of the edges, as a share of half the width,
SIDE_SHARE = 0.5  # plus this share where a side shows too,
MAX_HALF_WIDTH = 1.0  # which counts up to this share of the range: a wider box contains more than one thing
DEPTH_SHARE = 0.2  # 1 sigma of that distance, as a share of half the width,
MIN_DEPTH = 0.015  # plus this share of the range
MIN_WEIGHT = 0.2  # total weight of the pairs that a mean needs
UNSTEADY = 0.1  # likelihood of any range of a mover by the change of its looming: its own velocity may have changed
CALIBRATION = 0.9  # of all sigmas: then they hold the truth as often as they should, in worlds of the closed loop
RANGE_SHARE = 0.18  # 1 sigma of the range, as a share, that images of one object have in common
MIN_SHARE = 1e-5  # pairs with less weight are left out
RANGE, FORWARD, RIGHT, RATE, LATERAL, CLOSEST, QUANTITIES = 0, 1, 2, 3, 4, 5, 6
TINY = 1e-300
ROOT_2 = math.sqrt(2.0)
INFINITY = float("inf")
NAN = float("nan")


class Evidence:
    """Measurements of one object, and the belief of the last frame.

    ``looming`` m, ``sideways`` q, 1/s, their variances and covariance ``mm``, ``qq``, ``mq``; ``reference``, m/s, the
    vehicle's speed at which they were measured, which may differ now; ``across``, tan of the bearing from O;
    ``across_sigma``; ``half_width``, tan of half its width; ``half_extent``, of half its width or height, whichever is
    more; ``foot``, 1/Z of the ground under it, 1/m, with ``foot_sigma``; ``hidden``: probability that the foot shows no
    edge; ``is_cut``: it is below the image; ``ground``: 1/Z of the first ``grounds`` edges of the ground
    beneath it, 1/m. Of the last frame, propagated to now: ``log_odds`` of standing;
    ``range_before``, m, NaN: none, with ``range_doubt``, 1 sigma of its logarithm.
    """

    def __init__(self) -> None:
        self.looming = self.sideways = self.mm = self.qq = self.mq = 0.0
        self.reference = self.across = self.across_sigma = self.half_width = self.half_extent = 0.0
        self.foot = self.foot_sigma = self.log_odds = self.inverse = self.inverse_var = 0.0
        self.hidden, self.is_cut = HIDDEN_FOOT, False
        self.grounds, self.ground = 0, doubles(MAX_GROUNDS)
        self.range_before = self.range_doubt = NAN


class Belief:
    """The posterior belief.

    ``stands``: probability that it stands, and ``log_odds`` of that; ``met``: probability of contact within the
    horizon; ``middle``, m, range of the centre of its edges, with ``middle_sigma``, 1 sigma of its logarithm; ``mean``
    and ``sigma`` (QUANTITIES,), NaN: unknown, of ``RANGE`` m, of its front, ``FORWARD`` and ``RIGHT`` m/s over ground,
    ``RATE`` 1/s, inverse time to contact, ``LATERAL`` m, lateral miss, ``CLOSEST`` s until it is passed.

    ``inverse``: (RANGES,) the grid, 1/m; ``standing``, ``moving``: weights of its ranges, which sum to 1 over both;
    ``inner_…``: motion for one pair.
    """

    def __init__(self) -> None:
        self.stands = self.log_odds = self.met = 0.0
        self.middle = self.middle_sigma = NAN
        self.weight, self.mean, self.sigma = [doubles(QUANTITIES) for _ in range(3)]
        self.inverse, self.standing, self.moving = [doubles(RANGES) for _ in range(3)]
        self.inner_forward = self.inner_right = self.inner_forward_var = self.inner_right_var = 0.0
        self.inner_rate = self.inner_rate_var = 0.0


def see_ground(evidence: Evidence, inverse: float) -> None:
    """Note an edge of the ground beneath the object, and its 1/Z."""
    if evidence.grounds < MAX_GROUNDS:
        evidence.ground[evidence.grounds] = inverse
        evidence.grounds += 1


def log_normal2(dm: float, dq: float, mm: float, qq: float, mq: float) -> float:
    """Log density of a bivariate normal distribution, without its constant."""
    determinant = max(mm * qq - mq * mq, 1e-18)
    distance = (dm * dm * qq - 2 * dm * dq * mq + dq * dq * mm) / determinant
    return -0.5 * (distance + math.log(determinant))


def foot_likelihood(evidence: Evidence, inverse: float, around: Situation) -> float:
    """Likelihood of the lowest edge's image row at an inverse range.

    Nothing lies below the ground, so an object is no farther than the ground in that row. It may be nearer, as its
    lowest edge may lie above its foot: slightly, or, where the foot shows no edge, by ``LIFTED_M``.
    """
    apart = inverse - evidence.foot
    sigma = evidence.foot_sigma + FOOT_SHARE * inverse
    lifted = LIFTED_M * inverse / around.camera_height_m
    if apart < 0:
        ratio = apart / sigma
        sunk = max(math.exp(-0.5 * ratio * ratio), SUNK_FOOT)
        return sunk if evidence.is_cut else sunk * ((1 - evidence.hidden) / sigma + evidence.hidden / lifted)
    unseen = 1.0
    for n in range(evidence.grounds):
        if evidence.ground[n] + sigma < inverse:
            unseen *= SEEN_BENEATH
    unseen = max(unseen, LEAST_SEEN)
    if evidence.is_cut:
        return unseen
    near, far = apart / sigma, apart / lifted
    lifts = evidence.hidden / lifted * math.exp(-0.5 * far * far) * unseen
    return (1 - evidence.hidden) / sigma * math.exp(-0.5 * near * near) + lifts


def memory_likelihood(evidence: Evidence, inverse: float, around: Situation) -> float:
    """Likelihood of an inverse range by the last frame's range: objects do not jump, but the belief may be wrong."""
    if not evidence.range_before > 0:
        return 1.0
    sigma = max(evidence.range_doubt, MEMORY_SHARE)
    apart = math.log(inverse * evidence.range_before) / sigma
    return JUMPS_HZ * around.dt_s + math.exp(-0.5 * apart * apart) / sigma


def speed_change_log(evidence: Evidence, inverse: float) -> float:
    """Log likelihood of an inverse range by how the looming changed with the vehicle's speed."""
    if not evidence.inverse > 0:
        return 0.0
    apart = inverse - evidence.inverse
    return -0.5 * apart * apart / evidence.inverse_var


def small_log(evidence: Evidence, inverse: float) -> float:
    """Log likelihood of the size that the object would have at an inverse range."""
    small = math.log(max(2 * evidence.half_extent / (SMALL_M * inverse), TINY)) / SMALL_RATIO
    return -0.5 * small * small if small < 0 else 0.0


def walking_mps(around: Situation) -> float:
    """σ_w of movers, m/s."""
    return WALKS_MPS + TRAFFIC_SHARE * math.fabs(around.speed_mps)


def weigh(belief: Belief, evidence: Evidence, around: Situation) -> None:
    """Compute the weight of each pair of case and range."""
    farthest_m = max(FARTHEST_REACHES * math.fabs(around.speed_mps) * around.horizon_s, FARTHEST_M)
    ratio = math.pow(NEAREST_M / farthest_m, 1.0 / (RANGES - 1))
    inverse = 1 / NEAREST_M
    walks = walking_mps(around)
    most = -INFINITY
    for k in range(RANGES):
        belief.inverse[k] = inverse
        place = math.log(memory_likelihood(evidence, inverse, around))
        place += small_log(evidence, inverse)
        if around.camera_height_m > 0:
            place += math.log(foot_likelihood(evidence, inverse, around))
        changed = speed_change_log(evidence, inverse)
        dm = evidence.looming - inverse * evidence.reference
        wrong = SPEED_SHARE * inverse * evidence.reference
        floor = MIN_SIGMA_HZ * MIN_SIGMA_HZ
        mm, qq = evidence.mm + wrong * wrong + floor, evidence.qq + floor
        belief.standing[k] = place + changed + ODDS + evidence.log_odds
        belief.standing[k] += log_normal2(dm, evidence.sideways, mm, qq, evidence.mq)
        free, along = inverse * walks, inverse * ALONG_MPS
        slow = inverse * SLOW_MPS
        slow_log = log_normal2(dm, evidence.sideways, mm + slow * slow, qq + slow * slow, evidence.mq)
        mm += free * free
        free_log = log_normal2(dm, evidence.sideways, mm, qq + free * free, evidence.mq)
        along_log = log_normal2(dm, evidence.sideways, mm, qq + along * along, evidence.mq)
        likelihood = ALONG * math.exp(along_log) + SLOW * math.exp(slow_log) + (1 - ALONG - SLOW) * math.exp(free_log)
        belief.moving[k] = place + math.log(UNSTEADY + math.exp(changed)) + math.log(likelihood + TINY)
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


def suppose_standing(belief: Belief, evidence: Evidence, inverse: float, around: Situation) -> None:
    """Set the motion of an object that stands at a range.

    Its looming tells when it is met, whatever its range; V/Z counts less, since it may move slowly after all.
    """
    belief.inner_forward = belief.inner_right = belief.inner_forward_var = belief.inner_right_var = 0.0
    expected = inverse * around.speed_mps
    wrong = STANDS_SHARE * expected
    expected_var = wrong * wrong + MIN_SIGMA_HZ * MIN_SIGMA_HZ
    measured = evidence.looming + inverse * (around.speed_mps - evidence.reference)
    gain = expected_var / (expected_var + evidence.mm)
    belief.inner_rate = expected + gain * (measured - expected)
    belief.inner_rate_var = gain * evidence.mm


def suppose_moving(belief: Belief, evidence: Evidence, inverse: float, around: Situation) -> None:
    """Set the motion of an object that moves at a range: as measured, shrunk towards rest by its uncertainty."""
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
    """Lateral miss with the set motion, m, right positive."""
    time_s = 1 / belief.inner_rate
    right_m = evidence.across / inverse + belief.inner_right * time_s
    ahead_m = 1 / inverse + belief.inner_forward * time_s
    return path.miss(right_m, ahead_m, around)


def lateral_var(belief: Belief, evidence: Evidence, inverse: float) -> float:
    """Variance of the lateral miss, m²: by the sideways motion, and by the time until it is passed."""
    time_s = 1 / belief.inner_rate
    late_s2 = belief.inner_rate_var * time_s * time_s * time_s * time_s
    aside = evidence.across_sigma / inverse
    return time_s * time_s * belief.inner_right_var + belief.inner_right * belief.inner_right * late_s2 + aside * aside


def below(value: float, mean: float, variance: float) -> float:
    """Cumulative normal probability of a value."""
    return 0.5 * (1 + math.erf((value - mean) / (ROOT_2 * math.sqrt(max(variance, 1e-12)))))


def within(most: float, mean: float, variance: float) -> float:
    """Probability that a normally distributed quantity is at most ``most`` in size."""
    return below(most, mean, variance) - below(-most, mean, variance)


def met_probability(belief: Belief, evidence: Evidence, inverse: float, around: Situation) -> float:
    """Probability of contact with the set motion: within the half widths, within the horizon."""
    half_m = around.half_width_m + evidence.half_width / inverse
    lateral, variance = lateral_at(belief, evidence, inverse, around), lateral_var(belief, evidence, inverse)
    beside = within(half_m, lateral, variance)
    soon = 1 - below(1 / around.horizon_s, belief.inner_rate, belief.inner_rate_var)
    return beside * soon


def take(belief: Belief, quantity: int, weight: float, value: float, variance: float) -> None:
    """Add a value, with its variance, to the mean of a quantity."""
    belief.weight[quantity] += weight
    belief.mean[quantity] += weight * value
    belief.sigma[quantity] += weight * (value * value + variance)


def suppose(belief: Belief, weight: float, evidence: Evidence, inverse: float, around: Situation) -> None:
    """Add one pair of case and range to all means, by its weight."""
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
    """Turn sums into means and standard deviations; NaN where the weight is too small."""
    for quantity in range(QUANTITIES):
        weight = belief.weight[quantity]
        if weight < MIN_WEIGHT:
            belief.mean[quantity] = belief.sigma[quantity] = NAN
        else:
            mean = belief.mean[quantity] / weight
            belief.mean[quantity] = mean
            belief.sigma[quantity] = CALIBRATION * math.sqrt(max(belief.sigma[quantity] / weight - mean * mean, 0.0))


def set_front(belief: Belief, evidence: Evidence) -> None:
    """Refer range and times to the object's front, which is nearer than its edges by a share of its width.

    The mean of ``RANGE`` is that of the logarithm until then.
    """
    half_width = min(evidence.half_width, MAX_HALF_WIDTH)
    nearer = 1 - FRONT_SHARE * half_width - SIDE_SHARE * min(math.fabs(evidence.across), half_width)
    deep = DEPTH_SHARE * half_width + MIN_DEPTH
    belief.middle, belief.middle_sigma = math.exp(belief.mean[RANGE]), belief.sigma[RANGE]
    range_m = belief.middle * nearer
    belief.sigma[RANGE] = range_m * lengths.of(belief.sigma[RANGE], lengths.of(RANGE_SHARE, deep))
    belief.mean[RANGE] = range_m
    belief.mean[RATE] /= nearer
    belief.sigma[RATE] = lengths.of(belief.sigma[RATE], deep * belief.mean[RATE])
    belief.mean[CLOSEST] *= nearer
    belief.sigma[CLOSEST] = lengths.of(belief.sigma[CLOSEST], deep * belief.mean[CLOSEST])


def consider(belief: Belief, evidence: Evidence, around: Situation) -> None:
    """Compute the belief from the evidence; the vehicle's speed must be known."""
    weigh(belief, evidence, around)
    belief.met = 0.0
    for quantity in range(QUANTITIES):
        belief.weight[quantity] = belief.mean[quantity] = belief.sigma[quantity] = 0.0
    for k in range(RANGES):
        inverse = belief.inverse[k]
        if belief.standing[k] > MIN_SHARE:
            suppose_standing(belief, evidence, inverse, around)
            suppose(belief, belief.standing[k], evidence, inverse, around)
        if belief.moving[k] > MIN_SHARE:
            suppose_moving(belief, evidence, inverse, around)
            suppose(belief, belief.moving[k], evidence, inverse, around)
    conclude(belief)
    set_front(belief, evidence)
