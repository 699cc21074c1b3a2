"""The settings of an identification, for the report."""

from collections.abc import Sequence

from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.identification.dynamic.output_error import HORIZON
from bristle.identification.moving_runs import regressors as asked_regressors
from bristle.identification.moving_runs import turn_of
from bristle.identification.static.grid import GRID, PLAIN_GRID
from bristle.model.laws.registry import AUTO

_PEAK = {
    "auto": "a Stribeck peak where the data support it",
    "coulomb-viscous": "no Stribeck peak",
    "stribeck": "a Stribeck peak however unsure",
}


def settings_of(experiment: Experiment, asked_law: str, training: Sequence[Record]) -> dict[str, str]:
    """Thresholds, cut-offs and options in force; `asked_law` is `fit.law` as in the file."""
    fit = experiment.fit
    law, loads = fit.friction, fit.load
    rising = "".join(f", rising with the {name.replace('-', ' ')}" for name in loads)
    found = ", which the data chose (fit.law overrules)" if asked_law == AUTO or asked_law != fit.law else ""
    settings = {
        "law": f"{'+'.join((law.name, *loads))}{found}: {law.title}{rising}",
        "directions": fit.directions,
        "set-up": f"{fit.set_up}, {_PEAK[fit.model]}",
        "grid": f"{GRID} values of v_s, even in log(v_s), refined to the continuous minimum",
        "plain grid": f"{PLAIN_GRID} evenly spaced values of v_s",
        "v_s range": "a third of the slowest speed to the fastest",
    }
    if isinstance(fit.orders, tuple):
        _, turn = turn_of(experiment.joint.kind)
        settings["orders"] = f"{', '.join(map(str, fit.orders)) or 'none'}, periods per {turn}"
    if training:
        cutoffs = dict.fromkeys(f"{f(r.cutoff for r in training):.3g}" for f in (min, max))
        low_pass = f"{' to '.join(cutoffs)} Hz"
        settings |= {
            "position filter": f"4th-order Butterworth, zero phase, {low_pass}",
            "decimation": f"one sample in {fit.every}, both sides through 0.8 of the new Nyquist frequency, zero phase",
            "regressors": ", ".join(asked_regressors(experiment)) or "none",
        }
        chosen = ["fit.position_cutoff"] if fit.position_cutoff is None else []
        chosen += ["fit.decimation"] if "decimation" not in fit.model_fields_set else []
        if chosen:
            by = f"by the spectra, {' and '.join(chosen)} overrule{'s'[len(chosen) - 1 :]}"
            settings["filters"] = (
                f"low pass of {low_pass}, {f'one sample in {fit.every}' if fit.every > 1 else 'all samples'} ({by})"
            )
        if fit.predict == "position":
            settings["moving runs"] = (
                f"the motor simulated in windows of {HORIZON:g} s, and its position averaged over {fit.every} samples; "
                "position filter and decimation serve the start alone"
            )
        if (known := experiment.inertia) is not None:
            error = known.standard_error
            settings["inertia"] = f"{known.value:g} {f'+/- {error:g} (prior)' if error else '(fixed)'}"
    return settings
