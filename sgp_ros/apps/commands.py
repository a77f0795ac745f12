"""What each command of `sgp` calls; what is slow to load is loaded when it is needed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sgp_ros.report.progress import Progress

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping

    Result = Mapping[str, Any]


def reproduce(arguments: argparse.Namespace) -> Result:
    """Run the experiments of the paper."""
    from sgp_proof.paper.command import run_reproduction

    return run_reproduction(
        arguments.experiment,
        arguments.seeds,
        arguments.out,
        Progress('reproduce'),
        is_quick=arguments.quick,
    )


def bench(arguments: argparse.Namespace) -> Result:
    """Run benchmarks."""
    from sgp_proof.bench.command import run_bench

    return run_bench(arguments.names, arguments.out, Progress('bench'), is_quick=arguments.quick)


def demo(arguments: argparse.Namespace) -> Result:
    """Run the demonstration."""
    from sgp_ros.apps.demo import run_demo

    return run_demo(arguments.duration, arguments.seed, arguments.out, Progress('demo'))


def simulate(arguments: argparse.Namespace) -> Result:
    """Simulate a robot."""
    from sgp_ros.apps.simulation import run_simulation

    return run_simulation(
        arguments.robot,
        arguments.out,
        Progress('simulate'),
        duration_s=arguments.duration,
        rate_hz=arguments.rate,
        seed=arguments.seed,
        controller=arguments.controller,
        effects=arguments.effect,
        physical=arguments.physical,
        sensors=arguments.sensor,
    )


def replay(arguments: argparse.Namespace) -> Result:
    """Run a recording through the engine."""
    from sgp_ros.apps.replay import ReplayOptions, run_replay

    options = ReplayOptions(
        joint_states=arguments.joint_states,
        command=arguments.command_topic,
        model=arguments.model,
        is_learning=not arguments.frozen,
        truth=arguments.truth,
    )
    return run_replay(
        arguments.bag,
        arguments.robot,
        arguments.params,
        arguments.out,
        options,
        progress=Progress('replay'),
    )


def identify(arguments: argparse.Namespace) -> Result:
    """Identify a robot from a recording."""
    from sgp_ros.apps.identify import IdentifyOptions, run_identify
    from sgp_ros.batch.identification import IdentificationOptions

    options = IdentifyOptions(
        tests=arguments.test,
        joint_states=arguments.joint_states,
        command=arguments.command_topic,
        effort_source=arguments.effort,
        identification=IdentificationOptions(
            residual_inputs=None if arguments.inputs is None else tuple(arguments.inputs),
            holdout=arguments.holdout,
            share=arguments.share,
            stretch_s=arguments.stretch,
            cutoff=arguments.cutoff,
        ),
    )
    return run_identify(
        arguments.bag, arguments.robot, arguments.out, options, progress=Progress('identify')
    )


def diagnose(arguments: argparse.Namespace) -> Result:
    """Say what physics the nominal robot lacks."""
    from sgp_ros.apps.diagnose import DiagnoseOptions, run_diagnose

    options = DiagnoseOptions(
        sim=arguments.sim,
        tests=arguments.test,
        joint_states=arguments.joint_states,
        command=arguments.command_topic,
    )
    return run_diagnose(
        arguments.bag, arguments.robot, arguments.out, options, progress=Progress('diagnose')
    )


def import_recording(arguments: argparse.Namespace) -> Result:
    """Turn a table into a recording."""
    from sgp_ros.recordings.tables import import_table

    summary = import_table(arguments.file, arguments.map, arguments.out)
    print(f'{summary.samples} states of {", ".join(summary.joints)} in {summary.path}')
    return summary.to_mapping()
