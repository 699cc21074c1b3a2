"""Which parameters of a joint matter: local, mapped and global sensitivity, and Fisher information."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.moving_runs import load_columns, regressors_of
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, Lugre, ParameterName, effort, peak_parameters, static_estimated_of, unit
from bristle.model.parameters import Kind as JointKind
from bristle.progress import Progress, teller
from bristle.questions.sensitivity.formulas import Formulas, formulas
from bristle.questions.sensitivity.joint import KnownFriction, Request
from bristle.questions.sensitivity.local import Local, Map, SineMotion, claimed, grid, local, ranked, sensitivity_map
from bristle.questions.sensitivity.sobol import LEAST, Box, Global, box_of, global_sensitivity
from bristle.simulation.fisher import Information, gram, motion_jacobian, names_of, static_information, values_of

if TYPE_CHECKING:
    import pandas as pd

SAMPLES = 1024  # of the Sobol indices, if no other number is given
SEED = 0
_MOST = 2**17  # samples of the Sobol indices: some minutes for a joint of six parameters
_NOISE = 0.05  # assumed noise without a moving run, over alpha_0; white, at 1 kHz
_NAMED = 3  # parameters whose shares a sentence names


class Expected(NamedTuple):
    """Fisher information of one measurement, and the standard errors of the joint's own fit."""

    what: str
    information: Information
    errors: Mapping[ParameterName, float]  # of the joint's own fit
    noise: tuple[Finding, ...]  # source of the noise, and the parameters taken as known

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Identifiable parameters, (p,): to half the value, or with any finite error where the value may be zero."""
        errors, zero = self.information.standard_errors, ("offset", "gravity", "spring", "quadratic", "inertia")
        may_be_zero = np.array([x.name.startswith(zero) for x in self.information.names], dtype=bool)
        return (errors < levels.WIDE * np.abs(self.information.point)) | (may_be_zero & np.isfinite(errors))

    def to_frame(self, kind: JointKind) -> "pd.DataFrame":
        """One row per parameter: expected standard error, that of the joint's fit, and whether it is identifiable."""
        import pandas as pd

        info = self.information
        columns = (info.names, info.point.tolist(), info.standard_errors.tolist(), self.seen.tolist())
        rows = [
            {
                "measurement": self.what, "parameter": str(name), "value": value, "unit": unit(name.name, kind),
                "standard_error": error if seen else None, "percent": 100 * error / abs(value) if seen and value else None,
                "own_standard_error": self.errors.get(name), "seen": seen,
            }
            for name, value, error, seen in zip(*columns, strict=True)
        ]  # fmt: skip  # a table
        return pd.DataFrame(rows).astype(dict.fromkeys(("standard_error", "percent", "own_standard_error"), object))


@dataclass(frozen=True, slots=True, kw_only=True)
class SensitivityStudy:
    """Sensitivity of a joint's friction to its parameters. `bristle.report_of` gives its text, page and tables."""

    name: str
    kind: JointKind
    simulated: bool
    """Whether the joint was identified from simulated data."""
    model: KnownFriction
    motion: SineMotion
    box: Box
    """The parameters' 95 % intervals, by name."""
    local: Local
    settled: Array
    """Total shares over the last period of the motion, (6,), as of `local`."""
    map: Map
    expected: tuple[Expected, ...]
    sobol: Global | None
    formulas: Formulas | None
    """None where SymPy is not installed."""
    assumptions: tuple[Finding, ...]
    """What was assumed or left out."""
    seed: int = SEED

    def to_frame(self) -> "pd.DataFrame":
        """One row per parameter, the largest total share first: `rank`, `parameter`, `total`, `partial` and `settled`.

        A share is the RMS of p dT_f / dp over the RMS of T_f: total (through the bristle), partial (at fixed z), and
        total over the last period.
        """
        import pandas as pd

        shares = {"total": self.local.shares(), "partial": self.local.shares(partial=True), "settled": self.settled}
        frame = pd.DataFrame({"parameter": self.local.names, **shares}).set_index("parameter")
        frame = frame.loc[list(self.local.ranking)].reset_index()
        frame.insert(0, "rank", range(1, len(frame) + 1))
        return frame


def check_samples(samples: int) -> None:
    """Raise InputError where the number of samples is out of range; 0 leaves the Sobol indices out."""
    if samples and (not LEAST <= samples <= _MOST or samples & (samples - 1)):
        raise InputError(
            f"samples: got {samples}; expected a power of two from {LEAST} to {_MOST}, or 0 to leave the Sobol indices out"
        )


def study_sensitivity(
    joint: Joint, request: Request, samples: int = SAMPLES, progress: Progress | None = None
) -> SensitivityStudy:
    """Local, mapped and global sensitivity of a joint, and information of measurements; `samples`: `check_samples`."""
    model, motion, loop = request
    tell = teller(progress, 3)
    tell("derivatives along the motion")
    along_motion = local(model.p, motion)
    tell("map over amplitude and frequency")
    mapped = sensitivity_map(model.p, *grid(motion))
    box, cut = box_of(model.estimates)
    tell("information")
    expected = (_motion_information(joint, model, motion), _velocities_information(joint))
    sobol, written, left_out = None, None, list[Finding]()
    if not samples:
        left_out.append(Finding("sobol-not-asked", NOTE, "Sobol indices were not asked for (samples: 0)."))
    else:
        try:
            if isinstance(loop, str) or not box:
                raise InputError(loop if isinstance(loop, str) else "no parameter has a finite interval")
            along = replace(loop, amplitude=motion.amplitude, frequency=motion.frequency)
            sobol = global_sensitivity(model.p, box, along, samples=samples, seed=SEED, progress=progress)
        except InputError as why:
            left_out.append(Finding("no-sobol", NOTE, f"No Sobol indices: {why}."))
    try:
        written = formulas(model.p.law)
    except ValueError as error:  # no SymPy, or a law with an operation that no formula has
        left_out.append(Finding("no-formulas", NOTE, f"No formulas: {error}."))
    period = round(1 / (motion.frequency * motion.period))  # in samples
    return SensitivityStudy(
        name=joint.name, kind=joint.kind, simulated=joint.simulated, model=model, motion=motion, box=box, local=along_motion,
        settled=along_motion.shares(last=period), map=mapped,
        expected=tuple(x for x in expected if x is not None), sobol=sobol, formulas=written,
        assumptions=(*model.assumptions, *cut, *left_out),
    )  # fmt: skip  # a list of values


def _motion_information(joint: Joint, model: KnownFriction, motion: SineMotion) -> Expected:
    """Information of the torque along the motion about friction and the extra terms of the joint's own fit."""
    # Standard deviation of the white noise of a torque sample at the motion's period, N*m, and its source.
    fit, torque_unit = joint.moving, unit("torque", joint.kind)
    if fit is not None and fit.rms > 0:
        steps = np.diff(fit.time)
        between, variance_inflation = float(np.median(steps[steps > 0])), inflation(fit.residuals)
        ratio = np.sqrt(variance_inflation)
        correlated = f", times {ratio:.1f} for their correlation" if ratio > 1 else ""
        message = f"Noise: residuals of the moving runs' fit, {fit.rms:.2g} {torque_unit} per sample every {between:.3g} s{correlated}."
        source = Finding("noise-of-fit", NOTE, message, {"rms": fit.rms, "step": between, "ratio": ratio})
        noise = fit.rms * float(np.sqrt(variance_inflation * between / motion.period))
    else:
        white = _NOISE * float(np.mean([one.alpha_0 for one in ([model.p] if isinstance(model.p, Lugre) else model.p)]))
        message = (
            f"Noise: assumed white, {white:.2g} {torque_unit} ({100 * _NOISE:.0f} % of alpha_0) at 1 kHz; "
            "standard errors are proportional to it."
        )
        source = Finding("noise-assumed", CAUTION, message, {"noise": white})
        noise = white * float(np.sqrt(1e-3 / motion.period))

    course = motion.course
    values = fit.known if fit is not None else {ParameterName.parse("inertia"): 0.0}
    asked = [x for x in regressors_of([name.name for name in values], joint.kind) if x != "links"]
    columns = load_columns(asked, partial(getattr, course), course.velocity.size)
    terms = {ParameterName.parse(name): column for name, column in columns.items()}
    extra = {name: column for name, column in terms.items() if name in (fit.names if fit is not None else values)}
    friction = names_of(model.p)
    point = np.array([*values_of(model.p), *(values[name] for name in extra)])
    matrix = gram(motion_jacobian(course.velocity, motion.period, model.p, extra), noise)
    held = [name for name in friction if name in model.assumed and name.name in peak_parameters(joint.law)]
    errors = {name: e.standard_error for name, e in model.estimates.items() if e.standard_error}
    if fit is not None:
        errors |= {n: e.standard_error for n, e in fit.parameters.items() if n in extra and e.standard_error}
    information = Information(names=(*friction, *extra), point=point, matrix=matrix)
    return _expected("the motion", information, errors, source, held)


def _expected(
    what: str, full: Information, errors: Mapping[ParameterName, float], noise: Finding, held: Sequence[ParameterName]
) -> Expected:
    """The information without the parameters that are held, because the joint's own fit lacks them."""
    kept = [k for k, name in enumerate(full.names) if name not in held]
    names = tuple(full.names[k] for k in kept)
    information = Information(names=names, point=full.point[kept], matrix=full.matrix[np.ix_(kept, kept)])
    message = f"Taken as known, because the joint's own fit has none: {', '.join(map(str, held))}."
    known = [Finding("held-as-known", CAUTION, message, {"names": tuple(held)})] if held else []
    return Expected(what, information, errors, (noise, *known))


def _velocities_information(joint: Joint) -> Expected | None:
    """Information of the joint's own constant velocities, at the scatter of its points; None without a static fit."""
    fits = {d: fit for d, fit in joint.static.items() if d in ("+", "-", "both") and fit.rms and fit.velocity.size}
    sets = {d: p for d, fit in fits.items() if (p := fit.values()) is not None}
    if not sets:
        return None
    directions = [Direction.BOTH] if len(sets) == 1 else list(map(Direction, sets))
    static = static_estimated_of(joint.law)
    names = tuple(ParameterName(name, d) for d in directions for name in static)
    matrix, errors, held = np.zeros((len(names), len(names))), dict[ParameterName, float](), list[ParameterName]()
    for k, (d, p) in enumerate(sets.items()):
        fit, block = fits[d], slice(len(static) * k, len(static) * (k + 1))
        free = max(fit.degrees_of_freedom or fit.n - len(fit.names), 1)
        scatter = float(np.sqrt(fit.residuals @ fit.residuals / free))
        matrix[block, block] = static_information(fit.velocity, p, scatter)
        estimates = dict(zip(names[block], map(fit.parameters.get, static), strict=True))
        errors |= {name: e.standard_error for name, e in estimates.items() if e is not None and e.standard_error}
        held += [name for name, e in estimates.items() if e is None or e.value is None]
    point = np.concatenate([p[: len(static)] for p in sets.values()])
    information = Information(names=names, point=point, matrix=matrix)
    noise = Finding("noise-of-static-fit", NOTE, "Noise: the scatter of the points about the static fit.")
    return _expected("the constant velocities", information, errors, noise, held)


def findings(study: SensitivityStudy) -> tuple[Finding, ...]:
    """The parameters that matter most, where the paper's claim holds, and what each measurement identifies."""
    names, total = study.local.names, study.local.shares()
    largest, settled = (
        {name: float(shares[names.index(name)]) for name in ranked(shares, names)[:_NAMED]}
        for shares in (total, study.settled)
    )
    holds = claimed(total, names)
    others, last = (
        ", ".join(f"{name} {share:.2g}" for name, share in x) for x in (list(largest.items())[1:], settled.items())
    )
    later = f" In its last period, after the bristle's first deflection: {last}."
    first, share = next(iter(largest.items()))
    message = (
        f"{first} matters most for {study.motion.amplitude:.3g} {unit('position', study.kind)} at "
        f"{study.motion.frequency:.3g} Hz: its total share of the RMS {effort(study.kind)} is {share:.2g}, then "
        f"{others}. The paper's claim that alpha_0 and alpha_2 matter most "
        f"{'holds' if holds else 'does not hold'}.{later if list(settled) != list(largest) else ''}"
    )
    motion = {"amplitude": study.motion.amplitude, "frequency": study.motion.frequency}
    numbers = {**motion, "largest": tuple(largest.items())}
    found = [Finding("claim-holds" if holds else "claim-fails", NOTE, message, numbers)]

    # Amplitudes of the map at which the claim holds, at the lowest, the motion's own and the highest frequency.
    claim, amplitudes, frequencies = study.map.claim, study.map.amplitudes, study.map.frequencies
    where = []
    for j in dict.fromkeys((0, int(np.argmin(np.abs(frequencies - study.motion.frequency))), frequencies.size - 1)):
        broken, at = np.flatnonzero(~claim[:, j]), f"at {frequencies[j]:.2g} Hz"
        if broken.size == 0:
            where.append(f"{at} at every amplitude")
        elif broken[-1] + 1 == amplitudes.size:
            where.append(f"{at} not at the largest amplitude")
        else:
            where.append(f"{at} from {amplitudes[broken[-1] + 1]:.2g} {unit('position', study.kind)} up")
    leading, held = tuple(names[k] for k in np.unique(study.map.first)), int(claim.sum())
    message = (
        f"Of {claim.size} motions on the map it holds for {held}: {', '.join(where)}. "
        f"Parameters that rank first somewhere: {', '.join(leading)}."
    )
    found.append(Finding("claim-on-map", NOTE, message, {"motions": claim.size, "held": held, "first": leading}))

    # Parameters that each measurement identifies, and combinations that it hardly does.
    for expected in study.expected:
        all_of, more = expected.information.names, "".join(f" {x.message}" for x in expected.information.unseen)
        lost = tuple(name for name, seen in zip(all_of, expected.seen, strict=True) if not seen)
        if lost:
            message = (
                f"From {expected.what} alone {', '.join(map(str, lost))} would not be identifiable "
                f"(standard error over half the value).{more}"
            )
            found.append(Finding("not-told", CAUTION, message, {"names": lost}))
        else:
            message = f"From {expected.what} alone all of {', '.join(map(str, all_of))} are identifiable.{more}"
            found.append(Finding("all-told", NOTE, message, {"names": all_of}))
    return tuple(found)


def sobol_sentences(sobol: Global, kind: JointKind) -> tuple[Finding, ...]:
    """The largest indices of each output, then the intervals drawn from and the simulated motion."""
    spans = ", ".join(
        f"{s.parameter} [{s.low:.3g}, {s.high:.3g}]{' (log-uniform)' * s.logarithmic}" for s in sobol.spans
    )
    drawn = (
        "Parameters are drawn uniformly unless stated otherwise, and independently, although those of a fit are "
        f"correlated: {spans}. Seed {sobol.seed}."
    )
    simulated = (
        f"SIMULATED: a sine of {sobol.amplitude:.3g} {unit('position', kind)} at {sobol.frequency:.3g} Hz; in the loop the "
        "compensator keeps the nominal parameters while the plant is drawn. ± of an index is its "
        f"{100 * levels.CONFIDENCE:.0f} % bootstrap interval, which is conservative for these samples."
    )
    found = []
    for output in sobol.outputs:
        start = output.heading(kind)
        if not output.effects:
            found.append(Finding("no-indices", NOTE, f"{start}: {output.reason}"))
            continue
        first, *others = sorted(output.effects, key=lambda e: -e.total)
        named = [first, *(e for e in others if e.total >= levels.EXPLAINS)]
        listed = ", ".join(f"{e.parameter} {e.total:.2f} ± {e.total_half:.2f} ({e.first:.2f} alone)" for e in named)
        share = 1 - sum(e.first for e in output.effects)
        more = f"; interactions account for {share:.2f}" if share >= levels.EXPLAINS else ""
        message = f"{start}: total index {listed}{more}; {output.samples} samples, {output.evaluations} evaluations."
        total = tuple((e.parameter, e.total) for e in (first, *others))
        numbers = {"total": total, "samples": output.samples, "evaluations": output.evaluations}
        found.append(Finding("sobol-indices", NOTE, message, numbers))
    return (
        *found,
        Finding("drawn-from", NOTE, drawn, {"spans": tuple(map(tuple, sobol.spans)), "seed": sobol.seed}),
        Finding("indices-simulated", NOTE, simulated, {"amplitude": sobol.amplitude, "frequency": sobol.frequency}),
    )
