"""How often intervals are widened as runs scatter, and how often they cover the mean: `python benchmarks/repeats.py [--experiments 200]`.

Five repeats of one experiment, simulated: moving runs of gripper rotation (+) with an inertia, and runs that each give a whole curve of points at
constant velocity. In each run the true parameters are the same, or scatter about their mean by so many standard errors that a run has, each
independently. Printed are, per parameter: in how many experiments its interval is widened; the mean error by the scatter of parts over that of the
fit, before and after; and how often the 95 % interval covers the mean.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.identification.dynamic.descent import LOGARITHMIC, logarithms
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.dynamic.uncertainty import parts_of_runs
from bristle.identification.fits import Estimate, RunScatter
from bristle.identification.repeats import clustered, spreader, widened, wider_estimate
from bristle.identification.static.problem import from_points
from bristle.identification.static.solution import solve_static
from bristle.identification.static.uncertainty import parts_of_runs as parts_of_curves
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import INERTIA, Direction, Lugre, ParameterName
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate
from bristle.simulation import edro

REPEATS = 5
P = edro.TABLE_1["gripper rotation"].positive
TRUTH = {ParameterName(name, Direction.BOTH): value for name, value in P._asdict().items()} | {INERTIA: 1.27e-3}
SCATTER = (0.0, 3.0)
"""Between runs, in standard errors of a run."""
STEP, SECONDS = 2e-3, 6.0
NOISE = 1e-4
"""N*m, of a sample; of a point at constant velocity as well."""
SPEEDS = np.geomspace(0.15 * P.v_s, 0.8, 16)
Found = dict[ParameterName, tuple[Estimate, RunScatter]]


def main() -> None:
    """Print a table for each kind of run and each scatter."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--experiments", type=int, default=200)
    experiments = parser.parse_args().experiments
    print(f"{experiments} experiments of {REPEATS} runs")
    for what, once in (("moving runs", moving), ("curves of points", points)):
        error = errors(once)
        for scatter in SCATTER:
            print(f"{what}, scatter between runs of {scatter:g} standard errors of a run")
            table(list(repeated(once, experiments, {name: scatter * e for name, e in error.items()})))


def errors(
    once: Callable[[list[dict[ParameterName, float]], np.random.Generator], Found],
) -> dict[ParameterName, float]:
    """The standard error of one run by name, from the fit of all of them."""
    found = once([TRUTH] * REPEATS, np.random.default_rng(0))
    return {name: REPEATS**0.5 * (e.standard_error or 0.0) / x.widened for name, (e, x) in found.items()}


def repeated(
    once: Callable[[list[dict[ParameterName, float]], np.random.Generator], Found],
    experiments: int,
    scatter: Mapping[ParameterName, float],
) -> Iterator[Found]:
    """What each experiment finds."""
    for seed in range(experiments):
        rng = np.random.default_rng([seed, 1])
        truths = [
            {name: value + scatter.get(name, 0.0) * rng.standard_normal() for name, value in TRUTH.items()}
            for _ in range(REPEATS)
        ]
        yield once(truths, rng)


def moving(truths: list[dict[ParameterName, float]], rng: np.random.Generator) -> Found:
    """All parameters of moving runs, each with its own truth."""
    t = np.arange(0, SECONDS, STEP)
    lines = ((0.25, 0.3), (0.06, 1.3), (0.04, 3.1), (0.02, 7.0), (0.01, 12.0))
    records = []
    for k, truth in enumerate(truths):
        v = np.sum([a * np.sin(2 * np.pi * (f * t + rng.uniform())) for a, f in lines], axis=0)
        acceleration = np.gradient(v, t)
        friction = rollout(v, STEP, Lugre(*(truth[n] for n in list(TRUTH)[:6]))).torque
        torque = friction + truth[INERTIA] * acceleration + NOISE * rng.standard_normal(t.size)
        records.append(Record(file=f"run {k}", time=t, velocity=v, torque=torque, acceleration=acceleration))
    problem = dynamic_problem(records, ("both",), ("inertia",), 1, None)
    solved = fit_tracking(problem, TRUTH, "revolute", search=False)
    freedom, names = solved.solution.freedom, solved.fit.names
    scatter = clustered(*parts_of_runs(solved), solved.fit.parameters, freedom, logarithms(names))
    fit = widened(solved.fit, scatter, LOGARITHMIC)
    return {name: (fit.parameters[name], x) for name, x in fit.repeats.items()}


def points(truths: list[dict[ParameterName, float]], rng: np.random.Generator) -> Found:
    """The static parameters from points, each run a whole curve."""

    def torque(truth: Mapping[ParameterName, float]) -> Array:
        """Of a run, N*m, with noise."""
        names = [ParameterName(name, Direction.BOTH) for name in ("alpha_0", "alpha_1", "alpha_2", "v_s")]
        exact = evaluate(steady_torque_function(), SPEEDS, *(truth[name] for name in names))[0]
        return exact + NOISE * rng.standard_normal(SPEEDS.size)

    torques = [torque(truth) for truth in truths]
    whole = from_points(np.tile(SPEEDS, len(truths)), np.concatenate(torques), ("both",))
    core = solve_static(whole, FitOptions(), "revolute")
    runs = [(f"run {k}", from_points(SPEEDS, own, ("both",))) for k, own in enumerate(torques)]
    v_s = {ParameterName("v_s", Direction.BOTH)}
    scatter = clustered(*parts_of_curves(core, runs), core.parameters, core.freedom, v_s, independent=True)
    return {name: (_wider(core.parameters[name], x, name), x) for name, x in scatter.items()}


def _wider(e: Estimate, x: RunScatter, name: ParameterName) -> Estimate:
    if x.stretched == 1 or e.value is None:
        return e
    return wider_estimate(e, x, spreader(e.value, x.stretched, name.name, logarithmic=name.name == "v_s"))


def table(found: list[Found]) -> None:
    """Print how often each parameter is widened, and covered."""
    print(f"  {'':<10}{'sets':>6}{'widened':>9}{'scatter':>9}{'covered':>9}")
    every = [(name, e, x) for one in found for name, (e, x) in one.items()]
    for name in (*TRUTH, None):
        own = [(n, e, x) for n, e, x in every if name in (n, None)]
        if own:
            share = partial(np.mean, dtype=float)
            inside = share([bool(e.interval and e.interval[0] <= TRUTH[n] <= e.interval[1]) for n, e, _ in own])
            before, wide = share([x.before for *_, x in own]), share([x.widened > 1 for *_, x in own])
            print(f"  {name or 'all'!s:<10}{len(own):>6}{wide:>9.1%}{before:>9.2f}{inside:>9.1%}", flush=True)


if __name__ == "__main__":
    main()
