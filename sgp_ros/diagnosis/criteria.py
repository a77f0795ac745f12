"""Criteria of a diagnosis: every threshold that its answers depend on, in the order of the stages.

Each says what it means, its unit in brackets, and what holds it: the schema of diagnosis.json,
statistics of null worlds, drawn worlds or guards (`nulls_*.json`, `concealed_*.json` and
`diagnosis_guards.json` of `sgp_proof/results/`), the practice cases, a test by simulation, or
convention.
"""

from __future__ import annotations

import math

LEAST_SHARE = 0.004
"""Share of the mean squared effort below which nothing counts as physics [1]. The schema."""
SHARE_TOLERANCE = 0.6
"""Part of `LEAST_SHARE` that an estimated share must reach, for it has errors [1]. Nulls."""
COUNTED_SHARE = SHARE_TOLERANCE * LEAST_SHARE
"""Estimated share from which something counts as physics [1]. Both of the above."""
EVIDENCE = 10.0
"""Evidence that an effect must have, on the recording and on parts left out [nats]. Nulls."""

LOST_ENERGY = 0.1
"""Part of a joint's greatest kinetic energy that dry friction takes on the whole way, from which
it counts as physics where no joint has a motor [1]. Convention.
"""
MOST_MISSED = 0.2
"""Part of the inertial force that a robot without any effort may miss where nothing drives it [1].

Guards. A motor that is not recorded supplies what moves the joint, and more where it carries load.
"""
LEAST_MOTION = 25.0
"""Range of a joint's positions, in units of their noise, from which it moves [1]. Guards.

Encoders at rest show at most 18 units, heavy tails included; a swing over 35 counts of a coarse
encoder is diagnosed rightly. The first second of a drawn world shows 342 units and more, the
recordings of real machines 1900 and more.
"""
LEAST_ROWS = 20
"""Independent rows that a recording must leave: twice the parameters of a body [rows]. Guards.

Of drawn worlds with fewer rows 11 in 28 get a wrong verdict, from here on one in fifteen.
"""

UNSIGNED_SHARE = 0.1
"""Time in which a joint moves either way, to judge the sign of its effort [1]. Convention."""
UNSIGNED_ZERO, UNSIGNED_LOW = 0.1, 0.02
"""Effort near zero, of its root mean square, and how often a fold is there [1]. Convention."""

GAINS_STD = 0.5
"""Prior standard deviation of the logarithm by which gains differ from those stated [1].
Convention."""

SENSOR_REST = 0.2
"""Greatest part of the velocity's error that a lag of the sensor may leave [1]. Convention."""

FLOOR_SHARE = 1e-5
"""Errors of signals and filters that no model explains, of the mean square [1]. Practice cases."""

SIGNIFICANT = 0.05
"""Chance that anything is called significant where the motion has no part [1]. Convention."""
REGION_ENERGY = 0.95
"""Share of the energy of a discrepancy that the region it is confined to holds [1]. Simulation."""
REGION_ROWS = 0.5
"""Greatest share of the rows of a region; larger ones are not reported [1]. Simulation."""
REGION_LEAST_ROWS = 100
"""Rows below which no regions are reported [rows]. Simulation."""
REMAINDER_SHARE = 0.2
"""A joint has its own Z where it leaves this part of what the worst one leaves [1]. Convention."""

ADEQUATE_REST = 0.025
"""Greatest structured rest of an adequate model, relative to what it explains [1]. Nulls."""
COLOURED_REST = 0.1
"""The same of what follows from earlier rows, but not from the motion [1]. Convention.

It does not come back with the motion: no law of the motion can do better, and a law of the list
that stood for a disturbance in time would leave most of it.
"""
FORCE_ACCURACY = 0.1
"""Part of inertial forces to which motors, gears and clocks let efforts be known [1]. Convention.
"""
SLIGHT_REST = 0.1 * LEAST_SHARE
"""Rest that is adequate in any case, as a share of the mean squared effort [1]. Nulls."""
INDEPENDENT_ROWS = 100.0
"""Most rows that count as independent when rests are compared [rows]. Nulls.

The shape of a column is only nearly right, and what is wrong with it repeats in every row.
"""
SHAPE_ERROR = 0.001
"""Part of the discrepancy that the right column may leave for the same reason [1]. Nulls."""
PER_EFFECT, PER_PARAMETER = 10.0, 3.0
"""Least worth of an effect, and of each number that the data determine [nats]. Nulls."""
MOST_OPPOSED = 5.0
"""Greatest ratio of the effects' mean squares, added up, to that of their sum [1]. Nulls.

Or to that of all there is to explain, where this is more.
"""
DISTURBED = 25.0
"""Mean square, of what usual laws leave at other times, from which something else acts [1].
Convention. It is five deviations, over a hundredth of the recording.
"""
MOST_DISTURBED = 0.2
"""Greatest share of a recording that is left out because something else acts [1]. Convention."""
BENT_BODIES = 1.0
"""Strain of bodies from which physics is looked for beside those of the robot file [nats].
Convention.

It is that of one change of 1.4 prior standard deviations: less is worth no law.
"""
STATED_ERROR = 0.2
"""Standard deviation of errors that bodies of a robot file have, relative to their prior [1].
Convention.

It is 5 % of masses and radii: a model of a construction leaves out cables, screws and grease.
"""
NOTHING_EXPLAINED = 1.0 / ADEQUATE_REST
"""Excess of a model that explains nothing [1]. Follows."""
STRUCTURE_LEAST_SHARE = 0.1
"""Joints that leave less, relative to the worst one, are not looked at for structure [1]."""

UNNAMED_EXCESS = 4.0
"""Excess of laws that a force without a name beats: as likely wrong as four in five [1].
Convention."""
NEARLY = 1.0 / 3.0
"""A force without form leaves less than this part of what laws leave that say only nearly what
there is [1]. Convention."""
LAW_REST = 1e-3
"""Greatest rest that comes back with the motion beside a formula, relative to its force: 3 % of
it [1]. A form that the data chose has no error of form. Convention.
"""
LACKING = 1.5
"""Greatest ratio of what a formula leaves to what a spline that follows any law does, if it is
not chance at `SIGNIFICANT` [1]. Convention."""
BLURRED = 0.25
"""Speed, of the mean square one, below which dry friction may be blurred [1]. Convention."""
LEAST_LAW = 0.7
"""Probability from which a formula that was searched for is asserted [1]. Unlisted worlds."""

TEMPER = 0.3
"""Weight of a nat of the worth of a model in the odds of rivals [1]. Drawn worlds."""
LEAST_ODDS = 0.01
"""A rival below this, relative to the asserted model, is not looked at closely [1]. Convention."""
ALIKE = math.log(20.0) / TEMPER
"""Difference of the fits below which a recording prefers neither model [nats]. Convention."""
PER_UNUSUAL = ALIKE
"""Least worth of a law that few joints have, beyond the price of an effect [nats]. Convention.

Odds of one to twenty against laws that nearly every joint with a motor has, or that add to them.
"""
CLEARER = 2.0
"""Ratio of mean squared differences from which another motion separates models [1]. Convention."""
CALM_SHARE = 0.002
"""Share left at which "no mismatch" is as likely wrong as right [1]. Half of `LEAST_SHARE`."""
MOST_UNSEEN = 0.1
"""Share of the mean squared effort at which friction must show in a recording that is said to miss
nothing [1]. Convention.
"""
STANDING = 0.7
"""Probability of friction that stands at a joint with something unknown [1]. Convention."""
LEAST_ASSERTED = 0.5
"""Probability from which a finding is asserted beside others [1]. The schema."""
MOST_CERTAIN = 0.99
"""Greatest probability that is ever stated [1]. Drawn worlds."""

DOUBTED = 0.4
"""Greatest probability where the final model is worse than a constant [1]. Convention.

The same holds for a finding whose size may be zero, and for a law that few joints have where
physics is left at its joint.
"""
CARRIED_REST = 0.1
"""Largest rest of a model, as part of the discrepancy, where it was not fitted [1]. Convention.

Friction that is a third larger or smaller than it was leaves that.
"""
CARRIED_ERROR = 4.0
"""Ratio of mean squared errors from which held-out ones are not those of the fit [1]. Convention.
"""
INTERVAL = 1.96
"""Half the width of an interval of 95 %, in standard deviations [1]. Convention."""

SAME_LEVEL = 0.15
"""Difference, over the larger one, up to which levels of friction are the same [1]. Convention.

One number stands for friction that grows with the load, falls with speed and wanes as it warms up.
"""

NUMBER_ERROR = 0.003
"""Relative standard deviation that approximations of the signals add to numbers [1]. Practice."""
