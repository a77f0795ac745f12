"""What the discrepancy of a joint may depend on, row by row."""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations


def own_variables(equations: Equations, joint: int) -> dict[str, np.ndarray]:
    """Return position, velocity, effort and time of a joint, (N,) each.

    Positions of continuous joints are wrapped [rad or m]; velocity [rad/s or m/s]; the commanded
    effort, of actuated joints [N m or N]; time since the first state [s].
    """
    motion, low = equations.motion, equations.filter
    variables = {
        'position': motion.wrapped[low.rows, joint],
        'velocity': low(motion.velocity[:, joint]),
    }
    if motion.tree.is_actuated[joint]:
        variables['effort'] = low(motion.effort[:, joint])
    return variables | {'time': equations.time}
