"""The filter: one step takes a frame's corners and the vehicle's motion, and updates the tables."""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Config
from lcf_edge.filter import (
    alpha,
    block_matching,
    coarse_motion,
    derotation,
    driving,
    edge_expert,
    feedback,
    flow,
    flow_fit,
    ground_speed,
    key_frames,
    leaps,
    line_expert,
    matching,
    normal_circles,
    object_circles,
    object_prediction,
    patches,
    rebel_circles,
    rest,
    square_expert,
    turmoil,
)
from lcf_edge.filter import baselines as lines
from lcf_edge.filter import heading as headings
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.coarse_circles import CoarseGroups
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.derotation import OffLine
from lcf_edge.filter.driving import DrivingTest
from lcf_edge.filter.feedback import Candidates
from lcf_edge.filter.flow import Homography, Pinhole
from lcf_edge.filter.flow_fit import FlowFit
from lcf_edge.filter.glossy_floor import GlossyFloor
from lcf_edge.filter.ground_speed import GroundSpeed
from lcf_edge.filter.heading import Heading
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.inputs import KEYS, Corners, Motion
from lcf_edge.filter.key_frames import KeyFrames
from lcf_edge.filter.leaps import Leaps
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.memory import Doubles, integers, memory_of, octets
from lcf_edge.filter.normal_circles import Flowing
from lcf_edge.filter.patch_circles import PatchGroups
from lcf_edge.filter.patches import Patches
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.rebel_groups import RebelGroups
from lcf_edge.filter.rest import RestTest
from lcf_edge.filter.rolling_shutter import RollingShutter
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation, follow
from lcf_edge.filter.square_expert import Squares
from lcf_edge.filter.tables import CircleTable, CornerTable, EdgeTable, GroupTable, Mask, ObjectTable, PsiTable
from lcf_edge.filter.turmoil import Turmoil
from lcf_edge.lens import Lens
from lcf_edge.messages import Sizes
from lcf_edge.small_image import SmallImage

Matrix = npt.NDArray[np.float64]
Grey = npt.NDArray[np.uint8]

SURPRISE_PX = 4.0  # slack of the gates for an unpredicted rotation,
SURPRISES = 3.0  # plus this many times the rotation that the gyro lately missed,
GYRO_SIGMAS = 3.0  # but at most this many sigmas of the gyro
GROUND_SLOPE_RAD = 0.002  # 1 sigma of the slope of the ground ahead, against the path
SLOWEST_MPS = 0.05  # slower motion has no direction
FORGET = 0.3  # weight of the latest frame in the mean of what the gyro missed


@dataclass(frozen=True, slots=True)
class Residual:
    """The rotation that the gyro missed, by the flow alone, without the gyro's prior.

    ``turn_rad``: rotation vector (3,) of directions, as in ``Motion.rotation``; ``sigma_rad``: (3,), 1 sigma.
    """

    turn_rad: npt.NDArray[np.float64]
    sigma_rad: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Mounting:
    """How the camera is mounted, learnt from the flow while driving; signs as in ``camera.*_rad``.

    ``ahead_m``: distance ahead of the axle that does not steer. ``pitch_sigma_rad``, ``yaw_sigma_rad``,
    ``ahead_sigma_m``: 1 sigma.
    """

    pitch_rad: float
    yaw_rad: float
    ahead_m: float
    pitch_sigma_rad: float
    yaw_sigma_rad: float
    ahead_sigma_m: float


@dataclass(frozen=True, slots=True)
class Step:
    """Results of one step besides the tables.

    ``omitted``: bool (corners,), inside ψ. ``residual``: the rotation that the gyro missed, None: too few edges.
    """

    omitted: Mask
    sizes: Sizes
    residual: Residual | None


class LineCircleFilter:
    """The Line-Circle filter. Pure: no I/O, no clock, no threads; the same input gives the same bytes.

    All tables are allocated here, from ``config.memory``. Positions are px of the ideal pinhole of ``lens``; the lens
    itself is used only to look up corners by their position in the frame.
    """

    def __init__(self, config: Config, lens: Lens) -> None:
        memory = config.memory
        self.edges = EdgeTable(memory.edges_normal, memory.edges_rebel, memory.chains)
        self.normal = CircleTable(memory.circles_normal)
        self.rebel = CircleTable(memory.circles_rebel)
        self.objects = ObjectTable(memory.objects)
        self.psi = PsiTable(memory.psi)
        self.groups = GroupTable(memory.groups)
        self.corners = CornerTable(memory.corners)
        self._pinhole = Pinhole(lens.fx, lens.fy, lens.cx, lens.cy)
        self._settings = Settings(config.filter, self._pinhole)
        self._plane = ImagePlane(lens)
        self._index = CornerIndex(lens.width, lens.height, memory.corners)
        self._heading = Heading(config.camera, config.vehicle.half_width_m)
        self._around = Situation(config, self._pinhole)
        follow(self._around, self._heading.ray_x, self._heading.ray_y, math.nan, 0.0, 1.0)
        self._keys = KeyFrames()
        self._baselines = Baselines()
        self._fit = FlowFit()
        self._rest = RestTest()
        self._driving = DrivingTest()
        self.ground = GroundSpeed()
        self._homography = Homography()
        self._coarse = CoarseMotion(lens, SmallImage(lens.width, lens.height).side)
        self._coarse_groups = CoarseGroups(self._coarse.blocks.columns * self._coarse.blocks.rows)
        self._off_line = OffLine()
        self.shutter = RollingShutter(self._pinhole, lens.height, self._settings)
        self._missing_px = self._settings.leap_px  # rotation that the gyro lately missed
        capacity = self.edges.capacity
        self._verdicts, self._recent = Verdicts(capacity), Verdicts(1)
        self.floor = GlossyFloor(self._verdicts, self.edges, self._baselines, self._settings)
        self._leaps = Leaps(capacity)
        self._born, self._breaking = (integers(capacity) for _ in range(2))
        self._dead = octets(capacity)
        self._flowing = Flowing(capacity, memory.circles_normal)
        self._rebel_groups = RebelGroups(memory.edges_rebel, memory.circles_rebel)
        self.patches = Patches(config.filter.patches)
        self._patch_groups = PatchGroups(config.filter.patches)
        self._turmoil = Turmoil(lens.width, lens.height)
        self._squares = Squares(memory.circles_rebel, memory.objects, capacity)
        self._candidates = Candidates(memory.circles_normal)
        self._ids = Ids()  # one count, so that an id is unique among both kinds
        self._psi_ids, self._object_ids = Ids(), Ids()

    def table_bytes(self) -> dict[str, int]:
        """Bytes of each preallocated table; the work space of a step, also kept, takes less than the edges."""
        blocks = self._coarse.blocks
        return {
            "edges (E_n, E_r, α)": self.edges.nbytes,
            "circles_normal (C_n)": self.normal.nbytes,
            "circles_rebel (C_r)": self.rebel.nbytes,
            "objects (S)": self.objects.nbytes,
            "groups (λ)": self.groups.nbytes,
            "psi (ψ)": self.psi.nbytes,
            "corners": self.corners.nbytes,
            "corner index": self._index.nbytes,
            "patches": 4 * self.patches.grey.nbytes,  # the template and its three slopes
            "coarse motion": (KEYS + 26) * blocks.width * blocks.height,  # its images, three repacked
        }

    @property
    def focus(self) -> tuple[float, float]:
        """O, the focus of expansion, px."""
        return self._around.focus_x, self._around.focus_y

    @property
    def mounting(self) -> Mounting:
        """The mounting as learnt so far."""
        heading = self._heading
        return Mounting(
            math.atan(heading.mounted_y),
            -math.atan(heading.mounted_x),
            heading.lever_m,
            heading.sigma_y,
            heading.sigma_x,
            heading.lever_sigma_m,
        )

    @property
    def stands(self) -> bool:
        """Whether the vehicle is stationary by the image, although a speed is measured."""
        return bool(self._rest.stands)

    @property
    def drives(self) -> bool:
        """Whether the image says that the vehicle drives, whatever speed is measured."""
        return bool(self._driving.drives)

    def step(
        self,
        corners: Corners,
        motion: Motion,
        image: Grey | None = None,
        small: Grey | None = None,
        hidden: Grey | None = None,
    ) -> Step:
        """Process one frame. ``motion.dt_s`` must be positive.

        ``image``: uint8 (height, width), from which the corners come; without it no patches are tracked.
        ``small``: the same, downscaled by ``small_image``; without it no coarse motion is measured.
        ``hidden``: uint8 like ``small``, 1 where no world is seen, 0 elsewhere; without it, as in the last frame.
        """
        motion = self._rested(motion)
        self._take(corners)
        if hidden is not None:
            block_matching.hide(self._coarse.blocks, memory_of(hidden.reshape(-1)))
        if small is not None:
            coarse_motion.take(self._coarse, memory_of(small.reshape(-1)))
        self._derotate(motion)
        self._predict()
        omitted = self._omit()
        evicted = self._collect()
        self._find(motion)
        sigma_rad, residual = self._refine(motion)
        turmoil.count(self._turmoil, self.edges.columns, self._around, self._settings)
        self._update(sigma_rad)
        evicted += self._add()
        pixels = None if image is None else memory_of(np.ascontiguousarray(image).reshape(-1))
        if pixels is not None:
            patches.follow(self.patches, pixels, self._plane)
        rebels, left = self._detect()
        evicted += left
        evicted += self._update_circles(rebels)
        evicted += self.edges.trim()
        if pixels is not None:
            patches.renew(self.patches, self.edges.columns, pixels, self._plane, self._around)
        return Step(
            np.asarray(self.corners.omitted[: len(corners)].copy()),
            self._sizes(len(corners), omitted, evicted),
            residual,
        )

    def found_share(self, corners: Corners, rotation: Matrix, dt_s: float) -> float:
        """Return the share of the trusted edges that corners agree with if ``rotation`` is the camera's; 0: too few.

        ``rotation``: as in ``Motion``, over the ``dt_s`` since the last step.
        """
        self._take(corners)
        flow.set_homography(self._homography, self._pinhole, _memory(rotation), 0)
        edges, plane, settings = self.edges.columns, self._plane, self._settings
        return derotation.found_share(self._index, plane, edges, self.corners.columns, self._homography, dt_s, settings)

    def _rested(self, motion: Motion) -> Motion:
        """The motion, with speed 0 where the vehicle is stationary by the image."""
        self._rest.measured_mps = motion.speed_mps
        if not self._rest.stands:
            return motion
        key_frames.scale(self._keys, 0.0)
        return replace(motion, speed_mps=0.0)

    def _take(self, corners: Corners) -> None:
        """Take the frame's corners, and index them by position."""
        if len(corners) > self.corners.capacity:
            self.corners = CornerTable(len(corners))
            self._index = CornerIndex(self._plane.width, self._plane.height, len(corners))
        pixel = np.ascontiguousarray(corners.pixel, np.int32)
        position = np.ascontiguousarray(corners.position, np.float32)
        words = np.ascontiguousarray(corners.appearance).view(np.uint64)
        matching.take_corners(self.corners.columns, memory_of(pixel), memory_of(position), memory_of(words))
        matching.fill(self._index, self.corners.columns)

    def _derotate(self, motion: Motion) -> None:
        """Step 0, and the prediction of circles, patches, objects and ψ."""
        rotation = _memory(motion.rotation)
        headings.turn_heading(self._heading, rotation, motion.path_yaw_rate_radps, motion.dt_s)
        headings.turn_aside(self._heading, motion.speed_mps, motion.path_yaw_rate_radps)
        ray_x, ray_y = self._heading.ray_x + self._heading.aside_x, self._heading.ray_y
        self._around.lever_m = self._heading.lever_m
        was_known, before_mps = math.isfinite(self._around.speed_mps), self._around.assumed_mps
        follow(self._around, ray_x, ray_y, motion.speed_mps, motion.path_yaw_rate_radps, motion.dt_s)
        if math.isfinite(motion.speed_mps) != was_known:
            self._correct_way(before_mps)
        self._advance_keys(rotation, motion)
        self._warp(rotation)
        normal_circles.predict(self.normal.columns, self._plane, self._around)
        rebel_circles.predict(self.rebel.columns, self._around)
        rebel_circles.end_outside(self.rebel.columns, self._plane, self._around, self._settings)
        patches.predict(self.patches, self._around)
        object_prediction.predict(self.objects.columns, self._plane, self._around, self._settings)
        feedback.advance(self.psi.columns, self.normal.columns, self._around)  # ψ ends with its circle

    def _correct_way(self, before_mps: float) -> None:
        """Once the speed is known, or unknown, take the vehicle to have driven at the present one since the key frames.

        At ``before_mps``, as it seemed then, the static scene would now seem to gain or fall behind.
        """
        if math.fabs(before_mps) > SLOWEST_MPS:
            key_frames.scale(self._keys, self._around.assumed_mps / before_mps)
            patches.correct_way(self.patches, self._around.assumed_mps / before_mps)

    def _advance_keys(self, rotation: Doubles, motion: Motion) -> None:
        """Add the motion to the key frames, at an assumed speed where it is unknown."""
        x, y = self._heading.ray_x + self._heading.aside_x, self._heading.ray_y
        scale = 1 / math.sqrt(x * x + y * y + 1)
        way_m = self._around.assumed_mps * motion.dt_s
        key_frames.advance(self._keys, rotation, x * scale, y * scale, scale, way_m, motion.dt_s)

    def _warp(self, rotation: Doubles) -> None:
        """Apply H = K·R·K⁻¹ to every stored image position."""
        flow.set_homography(self._homography, self._pinhole, rotation, 0)
        coarse_motion.turn(self._coarse, rotation)
        roll = math.atan2(rotation[0, 1, 0], rotation[0, 0, 0])
        derotation.derotate_edges(self.edges.columns, self._homography, roll)
        derotation.derotate_circles(self.normal.columns, self._homography, roll)
        derotation.derotate_circles(self.rebel.columns, self._homography, roll)
        patches.derotate(self.patches, self._homography)
        object_prediction.derotate(self.objects.columns, self._homography)
        derotation.derotate_psi(self.psi.columns, self._homography)

    def _predict(self) -> None:
        """E'."""
        edge_expert.predict(self.edges.columns, self.normal.columns, self._around, self._settings)

    def _omit(self) -> int:
        """Omit corners inside ψ; return how many."""
        return line_expert.omit(
            self.psi.columns,
            self._index,
            self._plane,
            self.edges.columns,
            self.corners.columns,
            self._keys.number,
            self._settings,
        )

    def _collect(self) -> int:
        """Fill λ; return how many circles did not fit."""
        normal, rebel = self.normal.columns, self.rebel.columns
        return line_expert.collect(self.groups.columns, normal, rebel, self._settings.tr_cr)

    def _find(self, motion: Motion) -> None:
        """Match edges and corners."""
        slack_px = self._slack_px(motion)
        edges, corners, settings = self.edges.columns, self.corners.columns, self._settings
        matching.find(self._index, self._plane, edges, corners, slack_px, settings)
        leaps.find(self._leaps, self._index, self._plane, edges, corners, settings)

    def _slack_px(self, motion: Motion) -> float:
        """Uncertainty of the image shift by the rotation, px: by the gyro, or, if less, by what it lately missed."""
        gyro_px = GYRO_SIGMAS * motion.rotation_sigma_rad * self._pinhole.focal
        return min(gyro_px, SURPRISE_PX + SURPRISES * self._missing_px, self._settings.leap_px)

    def _refine(self, motion: Motion) -> tuple[float, Residual | None]:
        """Take out the rotation that the gyro missed; return the remaining sigma, rad, and the residual."""
        residual = None
        sigma_rad, off, edges = motion.rotation_sigma_rad, self._off_line, self.edges.columns
        corners, settings = self.corners.columns, self._settings
        if sigma_rad > 0 and derotation.measure_off_line(off, edges, corners, self._pinhole, settings):
            derotation.missing_rotation(off, self._pinhole.focal, sigma_rad)
            residual = Residual(np.array(off.alone), np.array(off.alone_sigma))
            a, b, c, sigma_rad = off.turn_x, off.turn_y, off.turn_z, off.sigma
            rotation = _memory(np.array([[1.0, -c, b], [c, 1.0, -a], [-b, a, 1.0]]))
            self._missing_px += FORGET * (math.hypot(a, b) * self._pinhole.focal - self._missing_px)
            key_frames.turn(self._keys, rotation)
            self._warp(rotation)
            self.shutter.measure(off, self.edges, self.corners, motion.rate_radps, motion.dt_s)
        else:
            self._missing_px = settings.leap_px  # lost: search everywhere
            self.shutter.lose()
        key_frames.inflate(self._keys, sigma_rad, self._around.dt_s)
        return sigma_rad, residual

    def _update(self, sigma_rad: float) -> None:
        """Classify, update and delete edges."""
        edges, settings, sigma_px = self.edges.columns, self._settings, sigma_rad * self._pinhole.focal
        edge_expert.update(
            edges, self.normal.columns, self.rebel.columns, self.corners.columns, sigma_px, self._around, settings
        )
        edge_expert.delete(edges, self._plane, self._dead, settings.tr_cr)

    def _add(self) -> int:
        """Add new landmarks; return how many edges, old or new, did not fit.

        When the table is full, new edges replace those trusted less than they are.
        """
        edges, settings = self.edges, self._settings
        room = min(edges.normal_room(), edges.capacity - edges.count)
        evicted = max(0, edge_expert.count_unclaimed(self.corners.columns) - room)
        if evicted:
            n = edges.count
            weak = edges.least_trusted(~edges.rebel[:n] & (edges.trust[:n] < settings.tr_new), evicted)
            dead = np.zeros(n, np.bool_)
            dead[weak] = True
            edges.remove(dead)
            room = max(0, room) + len(weak)
        start = edges.count
        edge_expert.add(
            edges.columns,
            self.normal.columns,
            self.corners.columns,
            self.groups.columns,
            self._around,
            room,
            self._keys.number,
            settings,
        )
        object_circles.join_rebels(
            edges.columns, start, self.rebel.columns, self.objects.columns, self._around, settings
        )
        return evicted

    def _detect(self) -> tuple[int, int]:
        """α: judge every matched edge that has a history; return how many rebels break the flow, and evictions."""
        edges, keys, baselines, around = self.edges.columns, self._keys, self._baselines, self._around
        verdicts, recent, settings = self._verdicts, self._recent, self._settings
        key = bool(alpha.key_is_due(edges, keys, around.dt_s, settings))
        if key:
            alpha.mark_key(edges, keys)
            block_matching.keep(self._coarse.blocks, (keys.number - 1) % KEYS)
        lines.measure(baselines, keys, self._homography, self._pinhole, around)
        self._fit_flow()
        coarse_motion.measure(self._coarse, keys, baselines, self._plane, around)
        alpha.judge_all(verdicts, edges, keys, baselines, around, settings)
        ground_speed.measure(self.ground, edges, verdicts, baselines, around)
        self.floor.measure(around)
        around.floor_mirrors = self.floor.is_glossy
        driving.measure(self._driving, verdicts, edges, baselines, around)
        around.ground_mps = self.ground.speed_mps
        alpha.release_obedient(verdicts, edges, around, settings)
        requested = alpha.decide(verdicts, recent, edges, keys, key, baselines, self._born, around)
        births, evicted = self._make_room(requested)
        alpha.give_births(verdicts, recent, edges, keys, key, baselines, self._born, births, settings)
        return alpha.gather_rebels(verdicts, edges, self._breaking), evicted

    def _fit_flow(self) -> None:
        """Fit rotation, O and noise to the whole image; learn the mounting; test whether the vehicle is stationary."""
        fit, around, heading, pinhole = self._fit, self._around, self._heading, self._pinhole
        fit.prior_x = headings.focus_sigma_rad(headings.sideways_sigma_rad(heading)) * pinhole.fx
        fit.prior_y = headings.focus_sigma_rad(heading.sigma_y) * pinhole.fy
        edges, settings = self.edges.columns, self._settings
        flow_fit.measure(fit, edges, self._keys, self._baselines, around, settings)
        around.turn_share = fit.turn_share
        of_flow_rad = math.hypot(fit.focus_sigma_y / pinhole.fy, GROUND_SLOPE_RAD)
        around.horizon_sigma_rad = min(settings.pitch_sigma_rad, of_flow_rad)
        around.flow_is_seen = fit.count > 0
        around.is_blind = not around.flow_is_seen and bool(turmoil.is_all_lost(self._turmoil, around.is_blind))
        if fit.count:
            around.focus_x += fit.focus_x
            around.focus_y += fit.focus_y
            around.horizon_y = around.focus_y
            headings.learn_mounting(heading, around, fit)
        around.lasting_var_x = fit.focus_sigma_x * fit.focus_sigma_x
        around.lasting_var_y = fit.focus_sigma_y * fit.focus_sigma_y
        around.focus_var_x = headings.focus_variance(fit.focus_sigma_x / pinhole.fx) * pinhole.fx * pinhole.fx
        around.focus_var_y = headings.focus_variance(fit.focus_sigma_y / pinhole.fy) * pinhole.fy * pinhole.fy
        rest.measure(self._rest, self.edges.columns, self._keys, self._baselines, around)

    def _make_room(self, requested: int) -> tuple[int, int]:
        """Make room for new rebels by releasing weak ones; return how many may be born, and how many did not fit."""
        edges, settings = self.edges, self._settings
        room = edges.rebel_capacity - edges.rebels
        excess = max(0, requested - room)
        if not excess:
            return requested, 0
        n = edges.count
        weak = edges.least_trusted(edges.rebel[:n] & (edges.trust[:n] < settings.tr_new), excess)
        for row in weak.tolist():
            alpha.send_home(edges.columns, row, self._around, settings)
        return min(requested, max(0, room) + len(weak)), excess

    def _update_circles(self, rebels: int) -> int:
        """Update circles, objects and ψ; return evictions."""
        edges, normal, rebel, psi = self.edges.columns, self.normal.columns, self.rebel.columns, self.psi.columns
        candidates, around, settings = self._candidates, self._around, self._settings
        normal.evicted = rebel.evicted = 0
        feedback.mark_ignored(candidates, psi)
        normal_circles.update(self._flowing, edges, normal, candidates.ignored, around, settings, self._ids)
        rebel_circles.update(
            self._rebel_groups,
            edges,
            rebel,
            self._verdicts,
            self._breaking,
            rebels,
            self.patches,
            self._patch_groups,
            self._turmoil,
            self._coarse,
            self._coarse_groups,
            self._baselines,
            around,
            settings,
            self._ids,
        )
        evicted = square_expert.update(
            self._squares,
            self.objects.columns,
            rebel,
            self._verdicts,
            edges,
            self.patches,
            self._coarse,
            self._coarse_groups,
            self._baselines,
            self._plane,
            around,
            settings,
            self._object_ids,
        )
        object_circles.update(self.objects.columns, rebel, edges, self._plane, around, settings, self._ids)
        evicted += feedback.write(psi, normal, edges, candidates, self._keys, around, settings, self._psi_ids)
        feedback.give_way(psi, candidates, edges, rebel, self._plane, settings.psi_margin_px)
        return int(evicted + normal.evicted + rebel.evicted)

    def _sizes(self, corners: int, omitted: int, evicted: int) -> Sizes:
        n = self.edges.count
        rebels = self.edges.rebels
        return Sizes(
            corners=corners,
            omitted=omitted,
            edges_normal=n - rebels,
            edges_rebel=rebels,
            chains=self.edges.chains,
            circles_normal=self.normal.count,
            circles_rebel=self.rebel.count,
            groups=self.groups.count,
            psi=self.psi.count,
            evicted=evicted,
            objects=self.objects.count,
        )


def _memory(rotation: Matrix) -> Doubles:
    """A rotation (3, 3) as memory for the loops, (1, 3, 3)."""
    return memory_of(np.ascontiguousarray(rotation, np.float64).reshape(1, 3, 3))
