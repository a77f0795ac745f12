"""The commands `sgp reproduce` and `sgp bench`, found by the entry-point group of `sgp`."""

from __future__ import annotations

from sgp_ros.cli import AddCommand


def add_commands(add: AddCommand) -> None:
    """Add both commands; what they run is loaded when they run."""
    parser = add(
        'reproduce', 'sgp_proof.paper.command:run_reproduction',
        'Run the experiments of the paper with all methods.',
        'sgp reproduce toy --seeds 20 --out out/reproduce',
    )  # fmt: skip
    parser.add_argument('group', metavar='NAME', nargs='?', default='all',
                        help='toy, reaction-wheel, arm, choices or all (default)')  # fmt: skip
    parser.add_argument('--seeds', type=int, metavar='N',
                        help='simulated worlds per experiment (default: 20)')  # fmt: skip
    parser.add_argument('--quick', dest='is_quick', action='store_true',
                        help='few seeds, under two minutes')  # fmt: skip
    parser = add(
        'bench', 'sgp_proof.bench.command:run_bench',
        'Measure speed and memory, compared with other packages and the limit of the machine.',
        'sgp bench step --out out/bench',
    )  # fmt: skip
    words = 'step, evidence, replay, diagnose or identify (default: all)'
    parser.add_argument('names', metavar='NAME', nargs='*', help=words)
    parser.add_argument('--quick', dest='is_quick', action='store_true',
                        help='small sizes, under a minute')  # fmt: skip
