"""How many tests all looks at a campaign are worth: `python -m sgp_proof.campaign.alarms`.

Estimates that never change, of known variance, are looked at after each recording up to the
horizon; the largest standardised step of all looks is kept. Its distribution says how many
independent tests have the same largest one: these are what the threshold is divided by.
"""

from __future__ import annotations

import numba
import numpy as np
from scipy import special

from sgp_proof.campaign.wear import measured
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.campaign.changes import HORIZON, LEAST_SIDE

SERIES = 100_000
LEVELS = (0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0005)


@numba.njit(cache=True)
def largest_step(y, least):
    """Return the largest |z| of a step, over all looks and places."""
    total = np.cumsum(y)
    largest = 0.0
    for n in range(2 * least, len(y) + 1):
        whole = total[n - 1]
        for k in range(least, n - least + 1):
            before = total[k - 1]
            # (mean after - mean before)^2 / (1 / k + 1 / (n - k))
            size = k * whole - n * before
            squared = size * size / (float(n) * k * (n - k))
            largest = max(largest, squared)
    return np.sqrt(largest)


def equivalent_tests(series, seed=0):
    """Return by level the threshold, and the number of tests it is worth."""
    rng = np.random.default_rng(seed)
    largest = np.array([largest_step(rng.standard_normal(HORIZON), LEAST_SIDE)
                        for _ in range(series)])  # fmt: skip
    found = {}
    for level in LEVELS:
        z = float(np.quantile(largest, 1.0 - level))
        found[f'{level:g}'] = {'z': z, 'tests': level / (2.0 * float(special.ndtr(-z)))}
    return found


def main():
    """Measure and write."""
    parser = make_parser(__doc__, 'campaign')
    parser.add_argument('--series', type=int, default=SERIES)
    arguments = parser.parse_args()
    found = equivalent_tests(arguments.series)
    kept = measured(arguments.out)
    kept['alarms'] = {
        'series': arguments.series, 'horizon': HORIZON, 'least_side': LEAST_SIDE, 'levels': found,
    }  # fmt: skip
    write_result(arguments.out, kept)
    print(found)


if __name__ == '__main__':
    main()
