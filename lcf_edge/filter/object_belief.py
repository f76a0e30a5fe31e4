"""What is believed of an object from the evidence of its motion: range, velocity over ground, contact and class."""

import math

from lcf_edge.filter import image_plane, lengths, path, range_belief, situation
from lcf_edge.filter.columns import ObjectColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.range_belief import Belief, Evidence
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import ObjectClass

UNSEEN_MPS = 0.3  # 1 sigma of the change of an unseen object's velocity in one second
BODY_SHARE = 0.1  # model error of m, 1 sigma, as a share: some edges lie farther off than the rest,
BODY_HZ = 0.015  # and in quadrature with it;
SWING_SHARE = 0.1  # the same of q
SWING_HZ = 0.006
PERSISTS_S = 0.055  # time constant with which the log odds of standing decay,
MAX_ODDS = 4.0  # which are clamped to this
FOOT_S = 1.2  # the same, with which the foot rises to a higher lowest edge,
FOOT_BELOW_S = 3.0  # if it was below the image
FOOT_PX = 2.0  # 1 sigma of the row of the lowest edge
BORDER_PX = 4.0
CUT_SHARE = 0.15  # of its height: if the lowest edge is this near to the image's border, the foot may be below it,
CUT_HIDES = 0.75  # with this probability
MOVES_SIGMAS = 1.5  # a velocity above this is significant
SLOW_MPS = 0.15
INTO_PATH = 0.2  # least sideways motion of an object that cuts in, as a share of its forward motion
FOOT_SHARE = 0.12  # 1 sigma of the height of the lowest edge above the foot, as a share of the object's,
ASSUMED_SHARE = 0.7  # and of the assumed speed, as a share; both without a speed
STILL_HZ = 0.05  # before a vehicle at rest, an object with a smaller looming and sideways rate is at rest too
RATE_SIGMAS = 1.0  # a time to contact is reported for a looming above this
EVEN = 0.5
MAX_RANGE_M = 1000.0  # larger ranges are not reported
UNKNOWN, STANDING, CROSSING = int(ObjectClass.UNKNOWN), int(ObjectClass.STANDING), int(ObjectClass.CROSSING)
ONCOMING, LEADING, CUTTING_IN = int(ObjectClass.ONCOMING), int(ObjectClass.LEADING), int(ObjectClass.CUTTING_IN)
INFINITY = float("inf")
NAN = float("nan")


def collect_evidence(evidence: Evidence, objects: ObjectColumns, o: int, plane: ImagePlane, around: Situation) -> None:
    """Set the evidence of an object, in angles, and update its foot."""
    fx, fy = around.pinhole.fx, around.pinhole.fy
    evidence.looming, evidence.sideways = objects.looming[o], objects.sideways[o]
    whole = lengths.of(BODY_SHARE * evidence.looming, BODY_HZ)
    evidence.mm, evidence.mq = objects.mm[o] + whole * whole, objects.mq[o]
    whole = lengths.of(SWING_SHARE * evidence.sideways, SWING_HZ)
    evidence.qq = objects.qq[o] + whole * whole
    evidence.across = (objects.x[o] - around.focus_x) / fx
    evidence.half_width = 0.5 * objects.width[o] / fx
    evidence.half_extent = max(evidence.half_width, 0.5 * objects.height[o] / fy)
    evidence.across_sigma = 0.5 * evidence.half_width
    bottom = objects.y[o] + 0.5 * objects.height[o]
    if around.camera_height_m > 0:
        per_m = fy * around.camera_height_m
        shown = (bottom - around.horizon_y) / per_m
        if not objects.foot[o] > shown:
            objects.foot[o] = shown
        else:
            low = around.horizon_y + objects.foot[o] * per_m + BORDER_PX
            time_s = FOOT_S if image_plane.project(plane, around.focus_x, low) else FOOT_BELOW_S
            objects.foot[o] += (1 - math.exp(-around.dt_s / time_s)) * (shown - objects.foot[o])
        evidence.foot = objects.foot[o]
        bottom = around.horizon_y + evidence.foot * per_m
        evidence.hidden = range_belief.HIDDEN_FOOT
        if not image_plane.project(plane, around.focus_x, bottom + CUT_SHARE * objects.height[o]):
            evidence.hidden = CUT_HIDES
        evidence.foot_sigma = math.sqrt(around.pitch_sigma_rad * around.pitch_sigma_rad + FOOT_PX * FOOT_PX / fy / fy)
        evidence.foot_sigma /= around.camera_height_m
    evidence.is_cut = not image_plane.project(plane, around.focus_x, bottom + BORDER_PX)
    evidence.reference = objects.reference[o]
    evidence.inverse, evidence.inverse_var = objects.inverse[o], objects.inverse_var[o]
    evidence.range_before, evidence.range_doubt = objects.middle[o], objects.middle_sigma[o]
    kept = math.exp(-around.dt_s / PERSISTS_S)
    evidence.log_odds = min(max(kept * objects.log_odds[o], -MAX_ODDS), MAX_ODDS)


def believe(objects: ObjectColumns, o: int, belief: Belief, evidence: Evidence, around: Situation) -> None:
    """Set the object's range, motion, risk and class from the belief."""
    objects.log_odds[o] = belief.log_odds
    objects.middle[o], objects.middle_sigma[o] = belief.middle, belief.middle_sigma
    objects.range[o], objects.range_sigma[o] = belief.mean[range_belief.RANGE], belief.sigma[range_belief.RANGE]
    objects.forward[o], objects.forward_sigma[o] = belief.mean[range_belief.FORWARD], belief.sigma[range_belief.FORWARD]
    objects.right[o], objects.right_sigma[o] = belief.mean[range_belief.RIGHT], belief.sigma[range_belief.RIGHT]
    objects.closest[o], objects.closest_sigma[o] = belief.mean[range_belief.CLOSEST], belief.sigma[range_belief.CLOSEST]
    objects.lateral[o], objects.lateral_sigma[o] = belief.mean[range_belief.LATERAL], belief.sigma[range_belief.LATERAL]
    objects.probability[o] = belief.met
    if objects.range[o] > MAX_RANGE_M:
        objects.range[o] = objects.range_sigma[o] = NAN
    if math.fabs(objects.lateral[o]) > MAX_RANGE_M:
        objects.lateral[o] = objects.lateral_sigma[o] = NAN
    set_contact(objects, o, belief.mean[range_belief.RATE], belief.sigma[range_belief.RATE], around)
    objects.class_id[o] = class_of(objects, o, belief, evidence)


def set_contact(objects: ObjectColumns, o: int, rate: float, sigma: float, around: Situation) -> None:
    """Set the time to contact from its inverse, 1/s; none where the looming is not above its noise."""
    if rate > RATE_SIGMAS * sigma and rate * range_belief.MAX_HORIZONS * around.horizon_s > 1:
        objects.ttc[o], objects.ttc_sigma[o] = 1 / rate, sigma / (rate * rate)
    else:
        objects.ttc[o], objects.ttc_sigma[o] = INFINITY, NAN


def class_of(objects: ObjectColumns, o: int, belief: Belief, evidence: Evidence) -> int:
    """Returns the class of an object by its motion over ground."""
    if belief.stands > EVEN:
        return STANDING
    forward, right = objects.forward[o], objects.right[o]
    goes_on = math.fabs(forward) > max(MOVES_SIGMAS * objects.forward_sigma[o], SLOW_MPS)
    goes_aside = math.fabs(right) > max(MOVES_SIGMAS * objects.right_sigma[o], SLOW_MPS)
    if goes_aside and (not goes_on or math.fabs(right) >= math.fabs(forward)):
        return CROSSING
    if not goes_on:
        return UNKNOWN
    if forward < 0:
        return ONCOMING
    into_path = goes_aside and right * evidence.across < 0 and math.fabs(right) > INTO_PATH * forward
    return CUTTING_IN if into_path else LEADING


def rests(objects: ObjectColumns, o: int, around: Situation) -> bool:
    """Whether neither an object nor the vehicle moves; the image then holds no new information about its range."""
    if not situation.is_at_rest(around) or objects.log_odds[o] < 0 or not objects.range[o] > 0:
        return False
    return is_still(objects, o)


def is_still(objects: ObjectColumns, o: int) -> bool:
    """Whether an object, before a vehicle at rest, is at rest too."""
    return math.fabs(objects.looming[o]) < STILL_HZ and math.fabs(objects.sideways[o]) < STILL_HZ


def coast(objects: ObjectColumns, o: int, evidence: Evidence, around: Situation) -> None:
    """Derive an object's numbers from its last position and velocity; unseen, they become more uncertain."""
    drift_mps = UNSEEN_MPS * math.sqrt(around.dt_s) if objects.unseen_s[o] > 0 else 0.0
    objects.forward_sigma[o] = lengths.of(objects.forward_sigma[o], drift_mps)
    objects.right_sigma[o] = lengths.of(objects.right_sigma[o], drift_mps)
    range_m, closing_mps = objects.range[o], around.speed_mps - objects.forward[o]
    right_mps = objects.right[o]
    if objects.unseen_s[o] > 0:
        objects.range_sigma[o] = lengths.of(objects.range_sigma[o], objects.forward_sigma[o] * around.dt_s)
    share = lengths.of(objects.range_sigma[o] / range_m, objects.forward_sigma[o] / max(closing_mps, SLOW_MPS))
    objects.probability[o] = 0.0
    objects.lateral[o] = objects.lateral_sigma[o] = objects.closest[o] = objects.closest_sigma[o] = NAN
    set_contact(objects, o, closing_mps / range_m, share * math.fabs(closing_mps) / range_m, around)
    if not math.isfinite(objects.ttc[o]):
        return
    time_s, time_sigma_s = objects.ttc[o], objects.ttc_sigma[o]
    objects.closest[o], objects.closest_sigma[o] = time_s, time_sigma_s
    right_m = range_m * evidence.across + right_mps * time_s
    objects.lateral[o] = path.miss(right_m, range_m + objects.forward[o] * time_s, around)
    aside = lengths.of(range_m * evidence.across_sigma, evidence.across * objects.range_sigma[o])
    late = lengths.of(objects.right_sigma[o] * time_s, right_mps * time_sigma_s)
    objects.lateral_sigma[o] = lengths.of(aside, late)
    half_m = around.half_width_m + evidence.half_width * range_m
    variance = objects.lateral_sigma[o] * objects.lateral_sigma[o]
    beside = range_belief.within(half_m, objects.lateral[o], variance)
    soon = range_belief.below(around.horizon_s, time_s, time_sigma_s * time_sigma_s)
    objects.probability[o] = beside * soon


def believe_without_speed(objects: ObjectColumns, o: int, evidence: Evidence, around: Situation) -> None:
    """Set an object's numbers without the vehicle's speed: time to contact from looming, range from the foot.

    Where the foot does not show, the chance to be met is that of something stationary, at the assumed speed.
    """
    objects.middle[o] = objects.middle_sigma[o] = objects.range[o] = objects.range_sigma[o] = NAN
    objects.lateral[o] = objects.lateral_sigma[o] = NAN
    objects.forward[o] = objects.forward_sigma[o] = objects.right[o] = objects.right_sigma[o] = NAN
    objects.closest[o] = objects.closest_sigma[o] = NAN
    objects.class_id[o] = UNKNOWN
    set_contact(objects, o, evidence.looming, math.sqrt(evidence.mm), around)
    range_m, doubt = around.assumed_mps * objects.ttc[o], ASSUMED_SHARE
    if around.camera_height_m > 0 and not evidence.is_cut:
        above = FOOT_SHARE * objects.height[o] / around.pinhole.fy / around.camera_height_m
        foot_sigma = lengths.of(evidence.foot_sigma, above)
        if evidence.foot > 2 * foot_sigma:
            range_m, doubt = 1 / evidence.foot, foot_sigma / evidence.foot
            objects.range[o], objects.range_sigma[o] = range_m, doubt * range_m
            objects.right[o], objects.right_sigma[o] = evidence.sideways * range_m, math.sqrt(evidence.qq) * range_m
    objects.probability[o] = 0.0
    if not math.isfinite(objects.ttc[o]):
        return
    time_s, time_sigma_s = objects.ttc[o], objects.ttc_sigma[o]
    right_mps, late_mps = evidence.sideways * range_m, math.sqrt(evidence.qq) * range_m
    lateral_m = range_m * evidence.across + right_mps * time_s
    aside = lengths.of(range_m * evidence.across_sigma, doubt * lateral_m)
    late = lengths.of(late_mps * time_s, right_mps * time_sigma_s)
    lateral_sigma_m = lengths.of(aside, late)
    if math.isfinite(objects.range[o]):
        objects.lateral[o], objects.lateral_sigma[o] = lateral_m, lateral_sigma_m
    half_m = around.half_width_m + evidence.half_width * range_m
    beside = range_belief.within(half_m, lateral_m, lateral_sigma_m * lateral_sigma_m)
    soon = 1 - range_belief.below(1 / around.horizon_s, evidence.looming, evidence.mm)
    objects.probability[o] = beside * soon
