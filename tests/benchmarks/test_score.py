"""The score on cases that can be counted by hand."""

import math

import numpy as np
import pytest

from benchmarks.score import Score, pool, score
from lcf_edge.messages import CIRCLE, PSI_REGION, Kind, PipelineScene, Shape, Sizes
from lcf_edge.rendered.truth import ObjectTruth, Truth

STEP_NS = 100_000_000  # 10 pictures a second
BOX = (100.0, 100.0, 40.0, 80.0)


def thing(number=1, box=BOX, *, threat=True, moving=False, visible=1.0, ttc_s=2.0):
    return ObjectTruth(number, f"thing_{number}", box, visible, 4.0, ttc_s, 0.0, threat, moving)


def truth(seq, *things):
    return Truth(seq * STEP_NS, seq, 2.0, 0.0, things)


def scene(seq, *circles, psi=(), corners=0, omitted=0):
    """Circles are (x, y) or (x, y, further fields)."""
    table = np.zeros(len(circles), CIRCLE)
    table["kind"], table["trust"], table["ttc"], table["radius"] = Kind.REBEL, 4.0, math.inf, 10.0
    for row, (x, y, *further) in zip(table, circles, strict=True):
        row["x"], row["y"] = x, y
        for name, value in (further[0] if further else {}).items():
            row[name] = value
    regions = np.array(list(psi), PSI_REGION) if psi else np.zeros(0, PSI_REGION)
    return PipelineScene(
        seq * STEP_NS, seq, 640, 480, 2.0, table, regions, sizes=Sizes(corners=corners, omitted=omitted)
    )


def run(circles_of, things_of, count=20, **options):
    """Score a drive by functions of the picture's number."""
    truths = [truth(seq, *things_of(seq)) for seq in range(count)]
    return score([scene(seq, *circles_of(seq)) for seq in range(count)], truths, **options)


def test_every_picture_after_the_first_half_second_is_a_hit():
    result = run(lambda _: [(120, 140)], lambda _: [thing()])
    assert (result.frames, result.hits, result.misses, result.false_circles) == (15, 15, 0, 0)
    assert (result.f1, result.recall, result.precision, result.latency_s) == (1.0, 1.0, 1.0, 0.0)
    assert (result.targets, result.targets_never_hit) == (1, 0)


def test_hits_misses_and_false_circles_make_the_ratios():
    result = run(lambda seq: [(120, 140)] if seq % 2 else [(500, 400)], lambda _: [thing()])
    assert (result.hits, result.misses, result.false_circles) == (8, 7, 7)
    assert result.recall == pytest.approx(8 / 15)
    assert result.precision == pytest.approx(8 / 15)
    assert result.f1 == pytest.approx(16 / 30)


@pytest.mark.parametrize(
    ("x", "y", "hit"),
    [(82.1, 140, True), (81.9, 140, False), (157.9, 140, True), (120, 72.1, True), (120, 71.9, False)],
)
def test_box_is_grown_by_a_quarter_and_8_px(x, y, hit):
    result = run(lambda _: [(x, y)], lambda _: [thing()])
    assert (result.hits > 0, result.false_circles == 0) == (hit, hit)


def test_normal_and_little_trusted_circles_do_not_count():
    result = run(
        lambda _: [(120, 140, {"kind": Kind.NORMAL}), (120, 140, {"trust": 2.9}), (500, 400, {"trust": 2.9})],
        lambda _: [thing()],
    )
    assert (result.hits, result.misses, result.false_circles) == (0, 15, 0)
    assert result.targets_never_hit == 1


def test_circle_on_a_mover_that_does_not_threaten_counts_only_strictly():
    harmless = thing(2, (400.0, 200.0, 50.0, 100.0), threat=False, moving=True)
    result = run(lambda _: [(120, 140), (420, 250)], lambda _: [thing(), harmless])
    assert (result.f1, result.mover_circles, result.false_circles) == (1.0, 15, 0)
    assert result.strict_f1 == pytest.approx(30 / 45)


def test_circle_on_what_stands_harmlessly_is_false():
    result = run(lambda _: [(120, 140)], lambda _: [thing(threat=False)])
    assert (result.false_circles, result.quiet_frames, result.false_per_quiet_frame) == (15, 15, 1.0)
    assert math.isnan(result.recall)


def test_target_counts_after_its_grace():
    appears = 10
    result = run(lambda _: [], lambda seq: [thing()] if seq >= appears else [])
    assert result.misses == 20 - appears - 3
    assert run(lambda _: [], lambda seq: [thing()] if seq >= appears else [], grace_s=0.0).misses == 10


def test_grace_begins_anew_when_it_was_hidden():
    result = run(lambda _: [], lambda seq: [thing(visible=0.2 if seq == 12 else 1.0)])
    assert result.misses == 15 - 1 - 3


def test_hidden_or_tiny_threats_are_no_targets_but_excuse_circles():
    for case in (thing(visible=0.2), thing(box=(100.0, 100.0, 7.0, 80.0))):
        result = run(lambda _: [(103, 140)], lambda _, case=case: [case])
        assert (result.hits, result.misses, result.false_circles, result.quiet_frames) == (0, 0, 0, 0)


def test_latency_runs_from_the_threat_to_the_first_hit():
    result = run(lambda seq: [(120, 140)] if seq >= 14 else [], lambda seq: [thing(threat=seq >= 10)])
    assert result.latencies_s == pytest.approx((0.4,))


def test_ttc_error_is_relative_and_only_below_four_seconds():
    circles = [(120, 140, {"ttc": 2.5})]
    assert run(lambda _: circles, lambda _: [thing(ttc_s=2.0)]).ttc_error == pytest.approx(0.25)
    assert math.isnan(run(lambda _: circles, lambda _: [thing(ttc_s=5.0)]).ttc_error)
    assert math.isnan(run(lambda _: [(120, 140)], lambda _: [thing()]).ttc_error)


@pytest.mark.parametrize(
    ("region", "covers"),
    [
        ((1, Shape.CIRCLE, 120, 140, 4, 4, 5), True),  # the middle
        ((1, Shape.CIRCLE, 60, 100, 70, 70, 5), False),
        ((1, Shape.RECTANGLE, 105, 140, 12, 80, 5), True),  # 11 of 40 columns
        ((1, Shape.RECTANGLE, 100, 140, 14, 80, 5), False),  # 7 of 40 columns
        ((1, Shape.CIRCLE, 100, 100, 80, 80, 5), True),  # about a third, not the middle
    ],
)
def test_psi_on_a_threat(region, covers):
    truths = [truth(seq, thing()) for seq in range(10)]
    result = score([scene(seq, psi=[region]) for seq in range(10)], truths)
    assert result.psi_on_threat_frames == (5 if covers else 0)


def test_psi_on_what_does_not_threaten_is_its_purpose():
    truths = [truth(seq, thing(threat=False)) for seq in range(10)]
    region = (1, Shape.CIRCLE, 120, 140, 40, 40, 5)
    results = [scene(seq, psi=[region], corners=100, omitted=30) for seq in range(10)]
    result = score(results, truths)
    assert (result.psi_on_threat_frames, result.omitted_share) == (0, pytest.approx(0.3))


def test_missing_result_is_a_miss_and_unknown_stamp_an_error():
    truths = [truth(seq, thing()) for seq in range(10)]
    assert score([], truths).misses == 5
    with pytest.raises(ValueError, match="no truth for the image"):
        score([scene(99)], truths)


def test_pooled_scores_add_up():
    good = run(lambda _: [(120, 140)], lambda _: [thing()])
    bad = run(lambda _: [(500, 400)], lambda _: [thing()])
    both = pool([good, bad])
    assert (both.hits, both.misses, both.false_circles, both.frames) == (15, 15, 15, 30)
    assert both.f1 == pytest.approx(0.5)
    assert pool([]) == Score()
