"""Result of a drive: collisions, brakings, false ones, mean speed."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from hil_mocks.closed_loop.exact import REMEMBERED_S
from hil_mocks.closed_loop.loop import Contact, Log

_BRAKES, _DONE = 0.85, 0.95  # a braking: below this share of the cruise speed, until above that
_STOPS_MPS2, _DELAY_S = 1.5, 0.35  # as the planner brakes
_BEFORE_S, _AFTER_S = 1.0, 0.5  # window before its begin and after its end in which the ideal planner may brake


@dataclass(frozen=True, slots=True)
class Braking:
    """From the first to the last image of it."""

    first: int
    last: int
    for_nothing: bool


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one drive, or of several together."""

    threats: int = 0  # bodies that a blind vehicle hits, and the planner with ground truth does not
    collisions: tuple[Contact, ...] = ()  # those that the planner with ground truth avoids
    unseen: int = 0  # of these, with what was out of view while braking would have helped
    brakings: int = 0
    for_nothing: int = 0
    speed_shares: tuple[float, ...] = field(default=())  # of the mean speed with the truth, one a drive

    @property
    def mean_speed_share(self) -> float:
        """Mean over the drives."""
        return sum(self.speed_shares) / max(len(self.speed_shares), 1)

    @property
    def contact_mps(self) -> float:
        """Mean speed at contact."""
        return sum(each.speed_mps for each in self.collisions) / max(len(self.collisions), 1)


def brakings(log: Log, right: Sequence[bool], fps: float) -> list[Braking]:
    """Return the brakings of a drive; `right`: whether the planner with ground truth would brake, for each image.

    A braking is false if that planner would not brake in any image of it, nor shortly before or after.
    """
    found: list[Braking] = []
    first: int | None = None
    before, after = round(_BEFORE_S * fps), round(_AFTER_S * fps)

    def end(last: int) -> None:
        if first is not None:
            around = right[max(first - before, 0) : last + after + 1]
            found.append(Braking(first, last, not any(around)))

    for number, (target_mps, cruise) in enumerate(zip(log.target_mps, log.cruise_mps, strict=True)):
        if first is None and target_mps < _BRAKES * cruise:
            first = number
        elif first is not None and target_mps >= _DONE * cruise:
            end(number - 1)
            first = None
    end(len(log.target_mps) - 1)
    return found


def brakes(target_mps: float, cruise_mps: float) -> bool:
    """Whether a speed is below the cruise speed, so that a braking at the same time is justified."""
    return target_mps < _DONE * cruise_mps


def was_in_view(log: Log, contact: Contact, fps: float) -> bool:
    """Whether an image showed the hit body early enough to stop, and late enough to be remembered then.

    If not, the planner with ground truth would have hit it as well in this drive.
    """
    at = round(contact.time_s * fps)
    fastest_mps = max(log.speed_mps[max(at - round(fps), 0) : at + 1], default=contact.speed_mps)
    last = at - round((_DELAY_S + fastest_mps / _STOPS_MPS2) * fps)
    first = last - round(REMEMBERED_S * fps)
    return any(contact.number in shown for shown in log.in_view[max(first, 0) : max(last, 0)])


def judge(log: Log, right: Sequence[bool], fps: float, truth: Log, blind: Log) -> Outcome:
    """Compare a drive with those of the planner with ground truth and of a blind vehicle in the same world."""
    unavoidable = {contact.number for contact in truth.contacts}
    threats = {contact.number for contact in blind.contacts} - unavoidable
    found = brakings(log, right, fps)
    collisions = tuple(contact for contact in log.contacts if contact.number not in unavoidable)
    return Outcome(
        len(threats),
        collisions,
        sum(not was_in_view(log, contact, fps) for contact in collisions),
        len(found),
        sum(braking.for_nothing for braking in found),
        ((log.distance_m / log.seconds) / (truth.distance_m / truth.seconds),),
    )


def pool(outcomes: Sequence[Outcome]) -> Outcome:
    """Several drives together."""
    return Outcome(
        sum(each.threats for each in outcomes),
        tuple(contact for each in outcomes for contact in each.collisions),
        sum(each.unseen for each in outcomes),
        sum(each.brakings for each in outcomes),
        sum(each.for_nothing for each in outcomes),
        tuple(share for each in outcomes for share in each.speed_shares),
    )
