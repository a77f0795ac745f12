"""Agreement of a recording with its robot once its connections are corrected.

`d = low(tau_nominal(q, v, a) - tau) = low(X) b + noise` with everyday unknowns b: inertial
parameters and, per joint, viscous and dry friction, an offset and a rotor, each with a wide normal
prior.
The evidence has b integrated out (Laplace), for the nominal robot alone, with bodies, with
friction too, and with a load, each with errors of bodies as files may have and as most have; the
best of these counts, so that an error of the connection must explain what all of them leave.
Beside friction, rows where it may hold a joint say nothing of that joint.

Where every joint has a recorded effort it is the evidence of the efforts, given the motion. A
joint without a motor has none that tells the size of its bodies, and a drive makes its effort of
the motion: there it is the evidence of the motion, which is in units of effort by inertia. With
recorded efforts that would prize inertia wherever gravity and friction prevail.

Beside open bodies the size of all efforts is open too, and so are the gains of drives, where no
effort is measured: these are looked for with known bodies, beside rotors and dry friction in the
place of bodies and friction. Viscous friction is left out there: with `kd` it is one law.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from sgp_ros.diagnosis.compare.bodies import body_directions, load_precision
from sgp_ros.diagnosis.compare.effort_noise import measured_noise
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.rest import resting
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory, observe
from sgp_ros.diagnosis.compare.volume import Loop, log_inertia, noisy_volume, part_of_noise
from sgp_ros.diagnosis.criteria import (
    FORCE_ACCURACY,
    INDEPENDENT_ROWS,
    SHAPE_ERROR,
    STATED_ERROR,
)
from sgp_ros.diagnosis.setup.correction import Acting, Correction, delayed
from sgp_ros.diagnosis.setup.rows import PER_PERIOD, WIDE, most_hz, spread
from sgp_ros.diagnosis.setup.unknowns import (
    FRICTION,
    OF_BODIES,
    OF_MOST,
    OF_ROTORS,
    SETS,
    Agreement,
    Explained,
    Unknowns,
    explained,
)
from sgp_ros.physics.servo import Servo
from sgp_ros.rigid.rigid_body import mass_matrix, torque_regressor
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion

_KEPT = 50
"""Clock offsets of which the efforts are remembered."""
_MOTIONS = 8
"""Corrected motions of which the columns are remembered."""
_MOST_INACCURATE = 0.05
"""Share of an effort that is small beside the forces in it which these may leave."""


class Probe:
    """A recording on which corrections are tried.

    Args:
        raw: the recording.
        tree: nominal robot.
        bandwidth: of the filters.
        knows_bodies: whether the bodies are those of the robot.

    Attributes:
        full: its motion at the full rate.
        motion: the same, smoothed so that no noise is aliased, and thinned.
    """

    def __init__(
        self, raw: RawTrajectory, tree: Tree, bandwidth: Bandwidth, *, knows_bodies: bool = False
    ) -> None:
        motion = observe(raw, tree, bandwidth)
        if (most := most_hz(motion)) < bandwidth.cutoff:
            bandwidth = bandwidth.up_to(most)
            motion = observe(raw, tree, bandwidth)
        every = max(1, int(1.0 / (raw.step * PER_PERIOD * bandwidth.cutoff)))
        self._raw, self.every = raw, every
        wide = WIDE * bandwidth.cutoff if every > 1 and not motion.is_static else math.inf
        smooth = ParallelFilter(1.0 / raw.step, wide, raw.segments)
        kept = spread(raw.segments, every, len(smooth.taps) // 2)
        ends = np.cumsum([len(rows) for rows in kept])
        segments = [slice(int(e) - len(rows), int(e)) for e, rows in zip(ends, kept, strict=True)]
        pick = np.concatenate(kept)
        thinned = self._thinned = partial(smooth.at, pick)
        self.motion = replace(
            motion, time=motion.time[pick], step=motion.step * every,
            position=thinned(motion.position), velocity=thinned(motion.velocity),
            acceleration=thinned(motion.acceleration), effort=thinned(motion.effort), drive=None,
            starts=tuple(s.start for s in segments),
        )  # fmt: skip
        self.full = motion
        self.filter = ParallelFilter(1.0 / self.motion.step, bandwidth.cutoff, tuple(segments))
        self.directions = body_directions(tree)
        k = tree.size
        self.driven = tree.is_actuated[:k]
        inertial = (self.motion.mass_diagonal * self.motion.acceleration).var(axis=0)
        self.power = np.where(self.driven, (self.motion.effort**2).mean(axis=0), inertial)
        self.power = np.where(self.power > 0.0, self.power, 1.0)
        # where large forces cancel their accuracy counts; in a wrong unit efforts only seem small
        cancelled = np.maximum(inertial / self.power - 1.0, 0.0)
        self._inaccuracy = np.minimum(FORCE_ACCURACY**2 * cancelled, _MOST_INACCURATE)
        d = self.motion.nominal_effort - self.motion.effort - self.motion.stated_force
        noise = measured_noise(raw, motion, bandwidth)
        self._noise_part = part_of_noise(noise, self.filter(d))
        self._pose = np.linspace(0, len(pick) - 1, 24).astype(int)
        self._M = self._mass(tree, tree.parameters, self.motion.position[self._pose])
        self._loop = Loop.of(motion, bandwidth.cutoff)
        inertia = self.motion.mass_diagonal.mean(axis=0)
        self._rotors = np.diag(inertia) if knows_bodies else None
        self._loads = {a: load_precision(self.directions, tree, a) for a in (1.0, STATED_ERROR)}
        self._known: dict[float, Acting] = {}
        self._columns: dict[tuple[object, ...], tuple[Unknowns, Unknowns]] = {}
        self._moving = ~resting(raw, motion, bandwidth)[pick]
        self._Y: np.ndarray | None = None  # fresh memory costs more than the computation

    @property
    def most_usual(self) -> int:
        """Number of the set of unknowns that most robots have."""
        return OF_MOST[self._rotors is not None]

    def acting(self, clock: float) -> Acting:
        """Return the recorded efforts taken `clock` later."""
        if clock not in self._known:
            if len(self._known) > _KEPT:
                self._known.clear()
            self._known[clock] = self._taken(clock).each(self._thinned)
        return self._known[clock]

    def _taken(self, clock: float) -> Acting:
        drive = self.full.drive
        none = np.zeros_like(self.full.effort)
        proportional, damping, other = none, none, none.copy()
        if isinstance(drive, Servo):
            proportional, damping, other = none.copy(), none.copy(), drive.feedforward
        for j in np.flatnonzero(self.driven):
            if isinstance(drive, Servo):
                proportional[:, j], damping[:, j] = drive.parts(int(j), -clock)
            elif drive is not None:
                other[:, j] = drive.effort(int(j), delay=-clock)
        if drive is None:
            other = delayed(self.full.effort, self._raw, clock)
        return Acting(proportional, damping, other)

    def agreement(
        self, correction: Correction, *unknowns: int, nominal: np.ndarray | None = None
    ) -> Agreement:
        """Return how well the recording agrees with the robot once it is corrected.

        Args:
            correction: what is undone.
            unknowns: numbers of sets of `SETS`, of which the best counts; of all without any.
            nominal: see `Agreement`, of all that are compared; None for that of this correction.
        """
        motion = correction.motion(self.motion, self.acting(correction.clock))
        moving = self._moving[:, correction.order]
        columns = whole, held = self._unknowns_of(correction.moves, motion, moving)
        acting = motion.effort + motion.stated_force
        d = whole.nominal - self.filter(acting)
        both = d, d if held is whole else held.nominal - self.filter(acting * moving)
        power = self._delivered(motion, correction)
        rms = np.sqrt(power)
        rows = min(INDEPENDENT_ROWS, len(d))
        size, p = FRICTION * rms, whole.bodies.shape[2]
        products = [whole.products(d, size)]
        products.append(products[0] if held is whole else held.products(both[1], size))
        own = [np.minimum(x.squares / power, 1.0) for x in products]
        tried: list[tuple[float, int, Explained]] = []
        usual = OF_BODIES if self._rotors is None else OF_ROTORS
        for number in unknowns or usual:
            kind = SETS[number]
            i = int(kind.level >= 2)
            floor = self._floor(own[i] if nominal is None else nominal) * power
            precision = self._loads[kind.accuracy] if kind.level == 3 else None
            found = explained(products[i], kind, power, floor, rows, precision)
            tried.append((found.evidence - kind.price * (self._rotors is None), number, found))
        shift = partial(self._shift, motion, correction, power)
        if self.full.has_all_efforts:  # inertia does not change what is best
            tried.sort(key=lambda t: -t[0])
            tried = [next((t for t in tried if np.isfinite(shift(t[2].b[:p]))), tried[0])]
        counted = [(worth + rows * shift(e.b[:p]), number, e) for worth, number, e in tried]
        worth, number, best = max(counted, key=lambda t: t[0])
        i = int(SETS[number].level >= 2)
        rest = (both[i] - columns[i].force(best.b, size)) / rms
        left, share = (rest**2).mean(axis=0), best.variance / power
        return Agreement(worth, number, left, both[i] / rms, rest, share, rows, own[i])

    def _shift(
        self, motion: ObservedMotion, correction: Correction, power: np.ndarray, w: np.ndarray
    ) -> float:
        """Return the evidence of the inertia of bodies w by row; -inf where none can be so.

        With by how much the density of recorded motions exceeds that of relative errors. Gains of
        drives that hold positions are stated in the unit in which these are recorded.
        """
        inertia = self._log_inertia(motion.tree, w, motion.position[self._pose])
        units, scale = (
            -0.5 * self.driven * np.log(power / self.power),
            np.log(abs(correction.scale)),
        )
        if self._loop.is_closed:
            inertia = inertia - scale
        else:
            units = units - scale
        shift = float(self._loop.volume(inertia, correction.kp, correction.kd).sum())
        if not np.isfinite(shift):
            return shift
        volume = noisy_volume(units, self._noise_part).sum()
        return 0.0 if self.full.has_all_efforts else shift + float(volume)

    def _delivered(self, motion: ObservedMotion, correction: Correction) -> np.ndarray:
        """Return the size of the efforts to which errors are relative, (k,) mean squares.

        The efforts that gains make of errors of position and velocity largely cancel; errors of
        these efforts do not, as neither a delay nor a filter reduces them. With known bodies the
        size of efforts is known too.
        """
        if not isinstance(self.full.drive, Servo):
            power = (motion.effort**2).mean(axis=0)
        elif self._rotors is not None:
            power = self.power
        else:
            acting = self.acting(correction.clock)
            stated = acting.size(1.0, 1.0)
            power = self.power * acting.size(correction.kp, correction.kd) / stated
            power = power[correction.effort_order] / correction.effort_scale**2
        return np.where(self.driven & (power > 0.0), power, self.power)

    def _unknowns_of(
        self, key: tuple[object, ...], motion: ObservedMotion, moving: np.ndarray
    ) -> tuple[Unknowns, Unknowns]:
        """Return the columns of a motion, of all rows and of those where joints are `moving`.

        Corrections of efforts alone leave them as they are.
        """
        if key not in self._columns:
            if len(self._columns) >= _MOTIONS:
                self._columns.clear()
            q, v, a = motion.position, motion.velocity, motion.acceleration
            self._Y = torque_regressor(motion.tree, q, v, a, self._Y)
            whole = self._of_rows(motion, np.ones_like(moving))
            held = whole if moving.all() else self._of_rows(motion, moving)
            self._columns[key] = whole, held
        return self._columns[key]

    def _of_rows(self, motion: ObservedMotion, moving: np.ndarray) -> Unknowns:
        assert self._Y is not None
        found = Unknowns.of(
            motion, self._Y, self.filter, self.directions, moving,
            has_rotors=self.full.has_all_efforts,
        )  # fmt: skip
        if self._rotors is None:
            return found
        return found.of_known_bodies(self.filter(motion.acceleration * moving), self._rotors)

    def _log_inertia(self, tree: Tree, w: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return that of changed bodies or rotors, (k,)."""
        if self._rotors is None:
            changed = tree.parameters + (w @ self.directions).reshape(tree.parameters.shape)
            return log_inertia(self._mass(tree, changed, poses), self._M)
        return log_inertia(self._mass(tree, tree.parameters, poses) + self._rotors * w, self._M)

    def _mass(self, tree: Tree, bodies: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return the mass matrices of bodies (b, 10) with the stated rotors, (poses, k, k)."""
        return mass_matrix(tree, bodies, poses) + np.diag(self.motion.rotors)

    def _floor(self, nominal: np.ndarray) -> np.ndarray:
        """Return the share of each effort, (k,), that no model explains."""
        floor = 1e-5 + SHAPE_ERROR * nominal
        return floor + self._inaccuracy if self.full.has_all_efforts else floor
