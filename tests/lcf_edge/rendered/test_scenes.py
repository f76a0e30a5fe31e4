"""Rendered drives: images, sensors and truth agree with each other and with independent geometry."""

import json
import math
from dataclasses import replace
from itertools import islice, pairwise

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import START_NS, Drop, Shadow
from lcf_edge.rendered.projection import Stage
from lcf_edge.rendered.rendering import Renderer
from lcf_edge.rendered.scenes import Box, Drive, Lamp, Lens, Paint, Profile, SensorNoise, Shake
from lcf_edge.rendered.trajectory import Trajectory
from lcf_edge.rendered.truth import passages, truth

SILENT = SensorNoise(gyro_radps=0, accel_mps2=0, speed_mps=0, yaw_rate_radps=0, image=0)
SHAKES = (
    Shake("pitch", 0.02, 7.0, 0.3),
    Shake("roll", 0.015, 5.0, 1.0),
    Shake("yaw", 0.01, 4.0, 2.0),
    Shake("heave", 0.004, 6.0, 0.0),
)


def hold(value):
    return Profile(((0.0, value),))


def drive(*boxes, speed=2.0, yaw_rate=0.0, seconds=4.0, **values):
    usual = Drive("test", 0, seconds, 20.0, hold(speed), hold(yaw_rate), boxes, noise=SILENT)
    return replace(usual, **values)


def standing(x, z, *, name="box", width=0.5, height=1.0, length=0.5, heading=0.0, grey=128.0):
    paint = Paint(5, grey=grey)
    return Box(name, width, height, length, ((0.0, x, z),), heading_rad=heading, paint=paint)


def moving(x, z, x_mps, z_mps, **values):
    path = ((0.0, x, z), (1.0, x + x_mps, z + z_mps))
    return replace(standing(x, z, **values), path=path)


def truth_at(spec, time_s=0.0):
    stage = Stage(spec)
    return {thing.name: thing for thing in truth(stage, stage.view(time_s), 0).objects}


def corners_3d(box):
    """The eight corners in world axes (x, y, z), y down."""
    base = np.insert(box.footprint(0.0), 1, 0.0, axis=1)
    return np.vstack([base, base - (0.0, box.height_m, 0.0)])


def changed(spec):
    """Bounds x0, y0, x1, y1 in px of what the boxes change in the first image."""
    with_boxes, without = (next(iter(scenes.frames(s)))[0].image for s in (spec, replace(spec, boxes=())))
    rows, columns = np.nonzero(cv2.absdiff(with_boxes, without) > 12)
    return np.array([columns.min(), rows.min(), columns.max(), rows.max()])


# Images and truth against projection by OpenCV.


@pytest.mark.parametrize(("pitch", "heading"), [(0.0, 0.0), (0.03, 0.4), (-0.05, -0.7)])
def test_box_is_the_projection_of_its_corners(pitch, heading):
    box = standing(0.6, 5.0, heading=heading)
    spec = drive(box, camera_pitch_rad=pitch)
    to_camera = cv2.Rodrigues(np.array([pitch, 0.0, 0.0]))[0].T
    points = (corners_3d(box) - (0.0, -spec.camera_height_m, 0.0)) @ to_camera.T
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), spec.lens.matrix, np.zeros(4))[0][:, 0]
    x, y, width, height = truth_at(spec)["box"].box
    np.testing.assert_allclose((x, y), pixels.min(axis=0), atol=1e-6)
    np.testing.assert_allclose((x + width, y + height), pixels.max(axis=0), atol=1e-6)


@pytest.mark.parametrize(
    "lens",
    [
        Lens(),
        Lens(320, 240, 220.0),
        Lens(model="radial-tangential", distortion=(-0.28, 0.07, 0.0002, 0.00002)),
        Lens(model="equidistant", focal_px=380.0, distortion=(-0.01, 0.005, 0.0, 0.0)),
    ],
    ids=["pinhole", "small", "radial-tangential", "equidistant"],
)
def test_image_shows_the_box_where_the_truth_says(lens):
    spec = drive(standing(-1.2, 5.0, heading=0.3, grey=20.0), lens=lens, shakes=SHAKES)
    x, y, width, height = truth_at(spec)["box"].box
    np.testing.assert_allclose(changed(spec), (x, y, x + width, y + height), atol=2.0)


def test_box_is_clipped_to_the_image():
    x, y, width, height = truth_at(drive(standing(0.0, 0.7, width=3.0, height=3.0)))["box"].box
    assert (x, y, width) == (-0.5, -0.5, 640)
    assert y + height <= 479.5


def test_surface_moves_exactly_with_its_homography():
    box = standing(0.0, 4.0, width=3.0, height=3.0)
    images = [frame.image for frame, _ in islice(scenes.frames(drive(box, shakes=SHAKES)), 3)]
    stage = Stage(drive(box, shakes=SHAKES))
    face = np.array([[-1.0, -1.2, 3.75], [1.0, -1.2, 3.75], [1.0, -0.2, 3.75], [-1.0, -0.2, 3.75]])
    quads = []
    for time in (0.0, 0.1):
        view = stage.view(time)
        seen = (face - view.position) @ view.attitude @ stage.optics.matrix.T
        quads.append((seen[:, :2] / seen[:, 2:]).astype(np.float32))
    back = cv2.warpPerspective(
        images[2], cv2.getPerspectiveTransform(quads[1], quads[0]), (640, 480), flags=cv2.INTER_CUBIC
    )
    inside = np.zeros((480, 640), np.uint8)
    cv2.fillConvexPoly(inside, quads[0].astype(np.int32), 255)
    still, carried = (cv2.absdiff(images[0], other)[inside > 0].mean() for other in (images[2], back))
    assert carried < 2.0 < 3 * carried + 2.0 < still


def test_nearer_box_hides_the_farther():
    far = standing(0.0, 8.0, name="far")
    seen = truth_at(drive(far, standing(0.0, 4.0, name="near", width=1.0, height=1.5)))
    assert seen["near"].visible == 1.0
    assert seen["far"].visible == 0.0
    assert seen["far"].threat
    assert not seen["far"].target
    half = truth_at(drive(far, standing(0.5, 4.0, name="near", width=1.0, height=1.5)))["far"]
    assert half.visible == pytest.approx(0.5, abs=0.12)


def test_small_in_the_image_is_no_target():
    thing = truth_at(drive(standing(0.0, 70.0), speed=30.0))["box"]
    assert thing.threat
    assert not thing.target


# Threats.


@settings(max_examples=60, deadline=None)
@given(x=st.floats(-3, 3), z=st.floats(1.0, 15.0), speed=st.floats(0.5, 4.0))
def test_straight_drive_past_a_standing_box(x, z, speed):
    spec = drive(standing(0.0, z), speed=speed)
    stage = Stage(replace(spec, boxes=(standing(x, z),)))
    way = passages(stage, 0.0, [0])[0]
    assert way.depth_m == pytest.approx(z - 0.25)
    assert way.ttc_s == pytest.approx((z - 0.25) / speed)
    if way.ttc_s < 11:
        assert way.lateral_m == pytest.approx(x, abs=1e-6)
    close = abs(abs(x) - 0.85) < 1e-6 or abs(way.ttc_s - 4.0) < 1e-6
    assert close or way.threat == (abs(x) < 0.85 and way.ttc_s < 4.0)


def test_a_camera_before_the_axle_is_nearer_to_what_lies_ahead_and_swings_out_in_a_turn():
    spec = drive(standing(0.0, 5.0))
    before = replace(spec, camera_ahead_m=0.5)
    assert passages(Stage(before), 0.0, [0])[0].depth_m == passages(Stage(spec), 0.0, [0])[0].depth_m - 0.5
    turning = replace(before, yaw_rate=Profile(((0.0, 0.4),)))
    quarter_s = np.array([math.pi / 2 / 0.4])
    camera, axle = Trajectory(turning).position(quarter_s)[0], Trajectory(turning).ground_position(quarter_s)[0]
    assert camera[[0, 2]] == pytest.approx(axle - np.array([0.5, 0.0]), abs=1e-6)  # it heads to the left by then


def test_arc_leads_to_what_lies_on_it_and_past_what_lies_ahead():
    radius = 5.0  # 2 m/s at 0.4 rad/s to the left
    on_arc = standing(-radius * (1 - math.cos(1.0)), radius * math.sin(1.0), name="arc")
    boxes = (on_arc, standing(0.0, 5.0, name="ahead"))
    turning, straight = truth_at(drive(*boxes, yaw_rate=0.4)), truth_at(drive(*boxes))
    assert turning["arc"].threat
    assert abs(turning["arc"].lateral_m) < 0.15
    assert not turning["ahead"].threat
    assert turning["ahead"].lateral_m > 1.0
    assert straight["ahead"].threat
    assert not straight["arc"].threat


def test_arc_is_where_the_vehicle_then_is():
    spec = drive(standing(-1.2, 6.0), yaw_rate=0.25, seconds=6.0)
    stage, predicted = Stage(spec), truth_at(spec)["box"].lateral_m
    times = np.arange(0.0, 5.0, 0.01)
    ahead = stage.trajectory.forward(times)
    offsets = spec.boxes[0].footprint(0.0) - stage.trajectory.ground_position(times)[:, None]
    before = np.einsum("nij,nj->ni", offsets, ahead).min(axis=1)
    passed = np.flatnonzero(before <= 0)[0]
    right = np.array([ahead[passed, 1], -ahead[passed, 0]])
    assert offsets[passed].mean(axis=0) @ right == pytest.approx(predicted, abs=0.02)


def test_crossing_threatens_when_paths_meet_in_time():
    speed, meets = 3.0, 3.0
    in_time = moving(-1.0 * meets, speed * meets + 0.25, 1.0, 0.0, name="in_time")
    late = moving(-1.0 * meets - 2.0, speed * meets + 0.25, 1.0, 0.0, name="late")
    seen = truth_at(drive(in_time, late, speed=speed))
    assert seen["in_time"].threat
    assert seen["in_time"].moving
    assert seen["in_time"].lateral_m == pytest.approx(0.0, abs=1e-6)
    assert not seen["late"].threat
    assert seen["late"].lateral_m == pytest.approx(-2.0, abs=1e-6)


def test_oncoming_and_leading_use_the_relative_speed():
    oncoming = moving(0.0, 6.25, 0.0, -1.0, name="oncoming")
    slower = moving(0.3, 3.25, 0.0, 1.0, name="slower")
    same = moving(-0.3, 3.25, 0.0, 2.0, name="same")
    seen = truth_at(drive(oncoming, slower, same, speed=2.0))
    assert seen["oncoming"].ttc_s == pytest.approx(2.0)
    assert seen["slower"].ttc_s == pytest.approx(3.0)
    assert seen["same"].ttc_s == math.inf
    assert math.isnan(seen["same"].lateral_m)
    assert [seen[name].threat for name in ("oncoming", "slower", "same")] == [True, True, False]


def test_behind_or_beside_the_camera_is_no_threat():
    assert truth_at(drive(standing(0.0, -3.0))) == {}
    beside = truth_at(drive(standing(0.7, 0.3, length=2.0)))["box"]
    assert not beside.threat
    assert beside.ttc_s == math.inf


def test_reversing_approaches_nothing_ahead():
    thing = truth_at(drive(standing(0.0, 3.0), speed=-1.0))["box"]
    assert (thing.threat, thing.ttc_s) == (False, math.inf)


# Sensors.


def turning_drive(**values):
    profile = Profile(((0.0, 0.0), (1.0, 0.4), (3.0, -0.2)))
    speed = Profile(((0.0, 1.0), (2.0, 2.0), (3.0, 0.5)))
    usual = drive(shakes=SHAKES, camera_pitch_rad=0.05)
    return replace(usual, speed=speed, yaw_rate=profile, **values)


def _samples(spec):
    samples = scenes.imu(spec)
    times = np.array([(s.stamp_ns - START_NS) * 1e-9 for s in samples])
    return times, np.array([s.gyro for s in samples]), np.array([s.accel for s in samples])


def test_gyro_integrates_to_the_rendered_rotation():
    spec = turning_drive()
    times, gyro, _ = _samples(spec)
    stage = Stage(spec)
    attitude = stage.view(times[0]).attitude
    for step, rate in zip(np.diff(times), (gyro[1:] + gyro[:-1]) / 2, strict=True):
        attitude = attitude @ cv2.Rodrigues(rate * step)[0]
    error = cv2.Rodrigues(attitude.T @ stage.view(times[-1]).attitude)[0]
    assert np.linalg.norm(error) < 2e-3


def test_specific_force_integrates_to_the_rendered_path():
    spec = turning_drive()
    times, _, accel = _samples(spec)
    stage = Stage(spec)
    views = [stage.view(time) for time in times]
    turned = np.array([view.attitude @ force for view, force in zip(views, accel, strict=True)])
    world = np.add(turned, (0, 9.81, 0))
    step = times[1] - times[0]
    velocity = (views[1].position - views[0].position) / step - world[0] * step / 2
    position = views[0].position.copy()
    for now, following in pairwise(world):
        position += velocity * step + (now / 3 + following / 6) * step**2
        velocity += (now + following) / 2 * step
    np.testing.assert_allclose(position, views[-1].position, atol=0.03)


def test_at_rest_the_accelerometer_points_away_from_the_ground():
    _, gyro, accel = _samples(drive(speed=0.0))
    np.testing.assert_allclose(gyro, 0.0, atol=1e-12)
    np.testing.assert_allclose(accel, np.tile((0.0, -9.81, 0.0), (len(accel), 1)), atol=1e-12)


def test_turning_left_is_negative_about_the_camera_axis_and_positive_in_the_odometry():
    spec = drive(yaw_rate=0.3)
    assert scenes.imu(spec)[100].gyro == pytest.approx((0.0, -0.3, 0.0))
    assert scenes.odometry(spec)[50].yaw_rate_radps == pytest.approx(0.3)
    assert Stage(spec).view(1.0).position[0] < -0.1


def test_sensor_noise_has_its_size_and_bias():
    noise = SensorNoise((0.01, -0.02, 0.03), 0.003, (0.1, 0.0, -0.1), 0.06, 1.01, 0.01, 0.005)
    spec = drive(speed=2.0, seconds=40.0, noise=noise)
    _, gyro, accel = _samples(spec)
    np.testing.assert_allclose(gyro.mean(axis=0), noise.gyro_bias_radps, atol=3e-4)
    np.testing.assert_allclose(gyro.std(axis=0), noise.gyro_radps, rtol=0.1)
    np.testing.assert_allclose(accel.mean(axis=0), (0.1, -9.81, -0.1), atol=6e-3)
    np.testing.assert_allclose(accel.std(axis=0), noise.accel_mps2, rtol=0.1)
    speeds = np.array([s.speed_mps for s in scenes.odometry(spec)])
    assert speeds.mean() == pytest.approx(2.02, abs=2e-3)
    assert speeds.std() == pytest.approx(0.01, rel=0.1)


def test_odometry_integrates_to_the_path():
    spec = turning_drive()
    inside = [s for s in scenes.odometry(spec) if START_NS <= s.stamp_ns <= START_NS + 4 * 10**9]
    assert np.trapezoid([s.speed_mps for s in inside], dx=1 / 50) == pytest.approx(
        spec.speed.integral(np.array([4.0]))[0], abs=2e-3
    )
    assert np.trapezoid([s.yaw_rate_radps for s in inside], dx=1 / 50) == pytest.approx(
        Stage(spec).trajectory.heading(np.array([4.0]))[0], abs=1e-3
    )


# What the camera does to the image.


def test_exposure_scales_the_image():
    full, dim = (
        next(iter(scenes.frames(drive(standing(0.0, 4.0), gain=hold(g)))))[0].image.astype(float) for g in (1.0, 0.5)
    )
    np.testing.assert_allclose(dim, full / 2, atol=0.51)


def test_noise_changes_from_image_to_image():
    spec = drive(standing(0.0, 4.0), speed=0.0, noise=replace(SILENT, image=3.0))
    (first, _), (second, _) = islice(scenes.frames(spec), 2)
    difference = first.image.astype(float) - second.image
    assert difference.std() == pytest.approx(3.0 * math.sqrt(2), rel=0.1)


def test_motion_blur_takes_away_detail():
    def detail(exposure_s):
        spec = drive(standing(1.0, 3.0), yaw_rate=0.8, exposure_s=exposure_s)
        return cv2.Laplacian(next(iter(scenes.frames(spec)))[0].image, cv2.CV_64F).std()

    assert detail(0.03) < 0.8 * detail(0.0)


def test_rows_are_read_one_after_the_other_and_the_middle_one_at_the_stamp():
    spec = drive(yaw_rate=0.8, readout_s=0.032)
    stage = Stage(replace(spec, readout_s=0.0))
    rolled = Renderer(Stage(spec)).image(stage.view(0.5)).astype(int)
    for band in (4, 5, 7):
        rows = np.s_[60 * band : 60 * band + 60]
        late = 0.032 * ((band + 0.5) / 8 - 0.5)
        same, other = (Renderer(stage).image(stage.view(0.5 + each)).astype(int) for each in (late, late - 0.02))
        assert np.abs(rolled[rows] - same[rows]).mean() < 0.1
        assert np.abs(rolled[rows] - other[rows]).mean() > 1.0


def test_the_own_shadow_stays_where_it_is_and_others_pass():
    own, passing = Shadow(0.0, 2.0, 1.0, 1.0, 0.5), Shadow(1.0, 2.0, 1.0, 1.0, 0.5, velocity_mps=0.5)
    for shadow, stays in ((own, True), (passing, False)):
        lit, dark = (
            np.array([frame.image.astype(float) for frame, _ in islice(scenes.frames(spec), 10)])
            for spec in (drive(), drive(shadows=(shadow,)))
        )
        shaded = dark[:, 240:] < 0.75 * lit[:, 240:]
        assert shaded[0].any()
        assert dark[0, 240:][shaded[0]].mean() == pytest.approx(0.5 * lit[0, 240:][shaded[0]].mean(), rel=0.05)
        both = (shaded[0] & shaded[9]).sum() / (shaded[0] | shaded[9]).sum()
        assert (both > 0.9) == stays


def test_a_tree_sways_with_its_foot_in_its_place_and_does_not_move():
    tree = replace(standing(1.0, 6.0, height=3.0), sway_m=0.3, sway_hz=0.5)
    spec = drive(tree, speed=0.0)
    upright, bent = (first_bounds(spec, time_s) for time_s in (0.0, 0.5))
    assert bent[2] - upright[2] == pytest.approx(500 * 0.3 / 5.75, rel=0.15)
    assert bent[3] == upright[3]
    assert not truth_at(spec, 0.2)["box"].moving


def first_bounds(spec, time_s):
    """Left, top, right, bottom of the first box's front."""
    faces = dict(Stage(spec).view(time_s).placed[0].faces)
    return faces[min(faces)].bounds


def first_image(spec):
    return next(iter(scenes.frames(spec)))[0].image


def test_own_parts_stay_in_their_place_and_hide_the_world():
    part = ((100.0, 300.0), (400.0, 300.0), (400.0, 479.0), (100.0, 479.0))
    spec = drive(standing(0.0, 3.0), own_parts=(part,), shakes=SHAKES)
    images = [frame.image for frame, _ in islice(scenes.frames(spec), 3)]
    inside = np.s_[301:479, 101:400]
    assert np.array_equal(images[0][inside], images[2][inside])
    assert not np.array_equal(images[0][:300], images[2][:300])
    bare = first_image(replace(spec, own_parts=()))
    assert np.array_equal(images[0][:299], bare[:299])
    assert cv2.absdiff(images[0][inside], bare[inside]).mean() > 10


def test_a_drop_hides_the_world_and_shows_it_upside_down_and_dirt_is_dark():
    bare = first_image(drive(lens=Lens())).astype(int)
    inside = np.s_[170:230, 290:350]
    outside = np.ones_like(bare, dtype=bool)
    outside[80:320, 200:440] = False
    for is_dirt in (False, True):
        covered = first_image(drive(lens=Lens(), drops=(Drop(320.0, 200.0, 60.0, is_dirt),))).astype(int)
        assert np.array_equal(covered[outside], bare[outside])
        assert cv2.Laplacian(covered[inside].astype(np.uint8), cv2.CV_64F).std() < 12  # noise is left
        brighter = covered[220:230, 290:350].mean() - covered[170:180, 290:350].mean()
        assert abs(brighter) < 5 if is_dirt else brighter > 10  # the sky is brighter than the ground
        assert (covered[inside].mean() < 80) == is_dirt


@pytest.mark.parametrize("place", [(-200.0, 200.0), (320.0, -200.0), (900.0, 200.0), (320.0, 700.0)])
def test_a_drop_beside_the_image_hides_nothing(place: tuple[float, float]) -> None:
    """As a drive has that is rendered for a smaller image."""
    bare = first_image(drive(lens=Lens()))
    assert np.array_equal(first_image(drive(lens=Lens(), drops=(Drop(*place, 60.0),))), bare)


def test_the_floor_mirrors_lamps_where_their_images_are():
    lamp = Lamp(0.5, 10.0, 0.6, 0.8)
    spec = drive(lamps=(lamp,), ceiling_m=2.5, gloss=0.5)
    lit, dark = (first_image(each).astype(int) for each in (spec, replace(spec, lamps=())))
    rows, columns = np.nonzero(np.abs(lit - dark) > 25)
    below = rows > 240
    for y_m, seen in ((-2.5, ~below), (2.5, below)):
        corners = np.array([(x, y_m + spec.camera_height_m, z) for x in (0.2, 0.8) for z in (9.6, 10.4)])
        expected = (corners @ spec.lens.matrix.T)[:, :2] / corners[:, 2:]
        found = np.array([columns[seen], rows[seen]])
        np.testing.assert_allclose(found.min(axis=1), expected.min(axis=0), atol=1.5)
        np.testing.assert_allclose(found.max(axis=1), expected.max(axis=0), atol=1.5)


def test_tiles_repeat():
    box = replace(standing(0.0, 3.0, width=3.0, height=3.0), paint=Paint(5, tile_m=0.5))
    face = first_image(drive(box))[100:300, 200:440].astype(float)
    period = round(0.5 * 500 / 2.75)  # px: the tile at the distance of the face
    across = [np.corrcoef(face[:, :-shift].ravel(), face[:, shift:].ravel())[0, 1] for shift in range(1, 2 * period)]
    assert np.argmax(across[period // 2 :]) + period // 2 + 1 == pytest.approx(period, abs=1)
    assert max(across[period // 2 :]) > 0.9


def test_sharpening_raises_what_differs_from_around():
    def contrast(sharpening):
        return cv2.Laplacian(first_image(drive(standing(0.0, 4.0), sharpening=sharpening)), cv2.CV_64F).std()

    assert contrast(1.0) > 1.5 * contrast(0.0)


def corner_counts(kind):
    detector = cv2.FastFeatureDetector_create(25)
    return [len(detector.detect(f.image)) for f, _ in scenes.frames(scenes.make(kind, 3, seconds=4, fps=1))]


def test_usual_scenes_have_enough_corners_and_plain_ones_few():
    assert 400 < np.median(corner_counts("passing")) < 1300
    assert 10 < np.median(corner_counts("low_texture")) < 200


# Kinds.


@pytest.mark.parametrize("kind", scenes.KINDS)
def test_kinds_threaten_for_part_of_the_drive(kind):
    spec = scenes.make(kind, 11, fps=1.0 if kind == "slow_rover" else 5.0)
    frames = list(scenes.truths(spec))
    threatened = [any(thing.target for thing in frame.objects) for frame in frames]
    assert len(frames) == round(spec.seconds * spec.fps)
    assert any(len(frame.objects) >= 5 for frame in frames)
    assert not threatened[0] or kind == "turn"
    assert any(threatened) == (kind not in ("passing", "reversing"))


def test_a_biased_gyro_is_off_by_5_to_20_degrees_a_second():
    drives = [scenes.make("biased_gyro", seed) for seed in range(3)]
    off = np.degrees(np.abs([drive.noise.gyro_bias_radps for drive in drives]))
    assert ((off > 5) & (off < 20)).all()


def test_names_are_unique_and_seeds_differ():
    drives = [scenes.make("crossing", seed) for seed in (0, 1)]
    for spec in drives:
        assert len({box.name for box in spec.boxes}) == len(spec.boxes)
    assert drives[0].boxes != drives[1].boxes


def test_same_spec_same_bytes():
    def run():
        spec = scenes.make("vibration", 4, seconds=1.0, fps=4.0, width=320, height=240, focal_px=250.0)
        return (
            [(f.image.tobytes(), t) for f, t in scenes.frames(spec)],
            scenes.imu(spec),
            scenes.odometry(spec),
        )

    assert repr(run()) == repr(run())


@pytest.mark.parametrize("change", [{"kind": "flying"}, {"seed": -1}, {"seconds": 0.01}, {"focal_px": 0.0}])
def test_impossible_drives_are_refused(change):
    with pytest.raises(ValueError, match=r"drive"):
        scenes.make(**{"kind": "passing", "seed": 0} | change)


# On disk.


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    spec = replace(
        scenes.make("oncoming", 2, seconds=1.0, fps=5.0, width=320, height=240, focal_px=250.0),
        lens=Lens(320, 240, 250.0, "radial-tangential", (-0.2, 0.05, 0.0, 0.0)),
    )
    return spec, scenes.write(spec, tmp_path_factory.mktemp("drive"))


def test_recording_has_the_layout_of_asl(recording):
    spec, folder = recording
    heads = {
        sensor: (folder / "mav0" / sensor / "data.csv").read_text().split("\n", 1)[0]
        for sensor in ("cam0", "imu0", "odom0")
    }
    assert heads == {
        "cam0": "#timestamp [ns],filename",
        "imu0": "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
        "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
        "odom0": "#timestamp [ns],v_x [m s^-1],w_z [rad s^-1]",
    }
    camera = dict(
        line.split(": ", 1) for line in (folder / "mav0/cam0/sensor.yaml").read_text().splitlines() if ": " in line
    )
    assert json.loads(camera["resolution"]) == [320, 240]
    assert json.loads(camera["intrinsics"].split(" #")[0]) == [250.0, 250.0, 159.5, 119.5]
    assert camera["distortion_model"] == "radial-tangential"
    assert json.loads(camera["distortion_coefficients"]) == list(spec.lens.distortion)
    assert "rate_hz: 200" in (folder / "mav0/imu0/sensor.yaml").read_text()


def test_recording_holds_what_was_rendered(recording):
    spec, folder = recording
    rows = (folder / "mav0/cam0/data.csv").read_text().splitlines()[1:]
    lines = [json.loads(line) for line in (folder / "truth.jsonl").read_text().splitlines()]
    rendered = list(scenes.frames(spec))
    assert len(rows) == len(lines) == len(rendered) == 5
    for row, line, (frame, known) in zip(rows, lines, rendered, strict=True):
        stamp, name = row.split(",")
        assert int(stamp) == frame.stamp_ns == line["stamp_ns"]
        image = cv2.imread(str(folder / "mav0/cam0/data" / name), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(image, frame.image)
        assert [thing["name"] for thing in line["objects"]] == [thing.name for thing in known.objects]
        for written, thing in zip(line["objects"], known.objects, strict=True):
            assert written["ttc_s"] == (None if math.isinf(thing.ttc_s) else thing.ttc_s)
            assert written["box"] == list(thing.box)
    imu = np.loadtxt(folder / "mav0/imu0/data.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(imu[:, 1:4], [s.gyro for s in scenes.imu(spec)], atol=1e-6)
    odometry = np.loadtxt(folder / "mav0/odom0/data.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(odometry[:, 1], [s.speed_mps for s in scenes.odometry(spec)], atol=1e-4)
