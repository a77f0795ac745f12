"""The figures of the paper, drawn from what was measured here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sgp_proof.paper import toy
from sgp_proof.paper.catalogue import Experiment
from sgp_proof.paper.figure_eight import ARM, tip_positions
from sgp_proof.paper.protocol import METHOD_NAMES, Outcome, World, thinned

COLOURS = dict(
    zip(METHOD_NAMES, ('#E69F00', '#009E73', '#CC79A7', '#0072B2', '#56B4E9'), strict=True)
)
"""Okabe and Ito 2008: told apart with every kind of colour vision."""
_GREY, _LINE = '#B8B8B8', '#555555'
_TRACE_S = 3.0
_BARS = {'reaction_wheel': 'fig4', 'reaction_wheel_concealed': 'fig6', 'arm': 'fig9'}
_TRACES = {
    'reaction_wheel': ('fig5', 'pole_up', 1),
    'reaction_wheel_concealed': ('fig7', 'pole_down', 0),
}


def draw_experiment(
    experiment: Experiment,
    outcomes: Mapping[str, Sequence[Outcome]],
    summary: Mapping[str, Any],
) -> dict[str, Figure]:
    """Return the figures of an experiment by file stem; a world is drawn from its first seed."""
    figures = {}
    if experiment.name == 'toy':
        world = experiment.make(0)
        figures['fig1'] = draw_toy(world, outcomes, ('PR', 'GP'))
        figures['fig2'] = draw_toy(world, outcomes, ('PRGP', 'SGP'))
    if experiment.name == 'arm':
        figures['fig8'] = draw_arm(experiment.make(0))
    if experiment.name in _BARS:
        figures[_BARS[experiment.name]] = draw_bars(experiment.title, summary)
    if experiment.name in _TRACES:
        name, region, channel = _TRACES[experiment.name]
        figures[name] = draw_traces(experiment.make(0), outcomes, region, channel)
    figures[f'calibration_{experiment.name}'] = draw_calibration(outcomes)
    return figures


def draw_toy(
    world: World, outcomes: Mapping[str, Sequence[Outcome]], methods: tuple[str, ...]
) -> Figure:
    """Draw data, truth and predictions over the position, as in figures 1 and 2."""
    figure = Figure(figsize=(7.5, 4.4), layout='constrained')
    axes = figure.add_subplot()
    train = thinned(world.train, world.size)
    axes.axvspan(*toy.SPARSE, color='#F2F2F2', lw=0, label='sparse data')
    axes.plot(train.U[:, 0], train.y[:, 0], '.', color=_LINE, ms=4, label='data')
    for label, region in (('truth', 'sparse'), (None, 'dense')):
        test = world.tests[region]
        axes.plot(test.data.U[:, 0], test.truth[:, 0], color=_GREY, lw=4, label=label)
    for method in methods:
        for label, region in ((method, 'sparse'), (None, 'dense')):
            mean = outcomes[method][0].means[region][:, 0]
            position = world.tests[region].data.U[:, 0]
            axes.plot(position, mean, color=COLOURS[method], lw=1.8, label=label)
    axes.set(xlabel='position [rad]', ylabel='acceleration [rad/s^2]')
    axes.legend(fontsize='small')
    return figure


def draw_arm(world: World) -> Figure:
    """Draw the curves of the tip and where joint 3 has its friction, as in figure 8."""
    figure = Figure(figsize=(12, 4), layout='constrained')
    runs = {'learned from': world.train, **{name: t.data for name, t in world.tests.items()}}
    panels = (('x [m]', 'y [m]', 0, 1), ('y [m]', 'z [m]', 1, 2))
    for i, (across, up, first, second) in enumerate(panels):
        axes = figure.add_subplot(1, 3, i + 1)
        for name, data in runs.items():
            tip = tip_positions(data.U[:, :3])
            axes.plot(tip[:, first], tip[:, second], lw=0.8, label=name)
        axes.set(xlabel=across, ylabel=up, aspect='equal')
    axes = figure.add_subplot(1, 3, 3)
    for name, data in runs.items():
        axes.hist(data.U[:, 2], bins=40, density=True, histtype='step', label=name)
    q = np.linspace(*np.percentile(np.concatenate([d.U[:, 2] for d in runs.values()]), (0, 100)))
    friction = ARM.frictions[2]
    axes.plot(q, friction.coulomb + friction.near_limits(q), color='k', label='dry friction [N m]')
    axes.set(xlabel='position of joint 3 [rad]', ylabel='density of samples, friction')
    axes.legend(fontsize='small')
    return figure


def draw_bars(title: str, summary: Mapping[str, Any]) -> Figure:
    """Draw the median nMSE of every method per region and channel, on a logarithmic axis."""
    regions = next(iter(summary.values()))
    figure = Figure(figsize=(5.2 * len(regions), 4.2), layout='constrained')
    figure.suptitle(title, fontsize='medium')
    for i, (region, channels) in enumerate(regions.items()):
        axes = figure.add_subplot(1, len(regions), i + 1)
        for m, method in enumerate(summary):
            medians = [summary[method][region][c]['nmse']['median'] for c in channels]
            places = np.arange(len(medians)) + (m - 2) * 0.16
            axes.bar(places, medians, 0.15, color=COLOURS[method], label=method)
        axes.set(yscale='log', title=region.replace('_', ' '), ylabel='nMSE, median over seeds')
        axes.set_xticks(range(len(channels)), list(channels))
        axes.axhline(1.0, color=_LINE, lw=0.8, ls=':')
    figure.legend(*axes.get_legend_handles_labels(), loc='outside lower center', ncols=5)
    return figure


def draw_traces(
    world: World, outcomes: Mapping[str, Sequence[Outcome]], region: str, channel: int
) -> Figure:
    """Draw predicted over true acceleration for a few seconds, as in figures 5 and 7."""
    methods = ('PR', 'GP', 'SGP')
    figure = Figure(figsize=(8, 6), layout='constrained')
    truth = world.tests[region].truth[:, channel]
    n = min(int(_TRACE_S * 100.0), len(truth))
    time = np.arange(n) / 100.0
    reach = 1.6 * np.abs(truth[:n]).max()
    for i, method in enumerate(methods):
        axes = figure.add_subplot(len(methods), 1, i + 1)
        axes.plot(time, truth[:n], color=_GREY, lw=4, label='true')
        mean = outcomes[method][0].means[region][:n, channel]
        axes.plot(time, mean, color=COLOURS[method], lw=1.4, label=method)
        axes.set_ylim(-reach, reach)
        axes.set_ylabel(world.channels[channel] + '\n[rad/s^2]')
        axes.legend(loc='upper right', fontsize='small')
    axes.set_xlabel('time [s]')
    return figure


def draw_calibration(outcomes: Mapping[str, Sequence[Outcome]]) -> Figure:
    """Draw the share of measurements inside central intervals against the stated level."""
    regions = list(next(iter(outcomes.values()))[0].pit)
    figure = Figure(figsize=(4.4 * len(regions), 4.2), layout='constrained')
    levels = np.linspace(0.0, 1.0, 101)
    for i, region in enumerate(regions):
        axes = figure.add_subplot(1, len(regions), i + 1)
        axes.plot(levels, levels, color=_LINE, lw=0.8, ls='--')
        _curves(axes, outcomes, region, levels)
        axes.set(
            title=region.replace('_', ' '), xlabel='stated level', ylabel='share inside',
            aspect='equal',
        )  # fmt: skip
    axes.legend(fontsize='small')
    return figure


def _curves(
    axes: Axes, outcomes: Mapping[str, Sequence[Outcome]], region: str, levels: np.ndarray
) -> None:
    for method, runs in outcomes.items():
        values = np.concatenate([run.pit[region].ravel() for run in runs])
        central = np.abs(2.0 * values - 1.0)
        share = (central[:, None] <= levels).mean(axis=0)
        axes.plot(levels, share, color=COLOURS[method], lw=1.6, label=method)
