"""The tables of `bristle sensitivity`, each a data frame and a CSV file."""

import numpy as np
import pandas as pd

from bristle.identification.fisher import names_of, values_of
from bristle.model.parameters import Kind, in_direction, unit
from bristle.questions.sensitivity.local import ranked
from bristle.questions.sensitivity.sobol import Global
from bristle.questions.sensitivity.study import Expected, SensitivityStudy
from bristle.questions.sensitivity.text import output_name

Frame = pd.DataFrame


def tables(study: SensitivityStudy) -> dict[str, Frame]:
    """Every table by the name of its file."""
    frames = {
        "parameters": parameter_table(study),
        "shares": share_table(study),
        "map": map_table(study),
        "information": pd.concat([information_table(study, e) for e in study.expected], ignore_index=True),
    }
    if study.formulas is not None:
        frames["formulas"] = pd.DataFrame(study.formulas.rows())
    if study.sobol is not None:
        frames["sobol"] = sobol_table(study.sobol, study.kind)
    return frames


def parameter_table(study: SensitivityStudy) -> Frame:
    """One row per parameter: value, unit, 95 % interval, whether it was assumed."""
    p, rows = study.model.p, []
    for name, value in zip(names_of(p), values_of(p).tolist(), strict=True):
        lower, upper = in_direction(study.box, *name) or (None, None)
        rows.append(
            {
                "parameter": str(name), "value": value, "unit": unit(name.name, study.kind), "lower": lower, "upper": upper,
                "assumed": name in study.model.assumed,
            }
        )  # fmt: skip  # a table
    return pd.DataFrame(rows).astype({"lower": object, "upper": object})


def share_table(study: SensitivityStudy) -> Frame:
    """One row per parameter, the largest total share first; columns as `SensitivityStudy.to_frame` has them."""
    frame = pd.DataFrame(
        {
            "parameter": study.local.names,
            "total": study.local.shares(),
            "partial": study.local.shares(partial=True),
            "settled": study.settled,
        }
    )
    frame = frame.set_index("parameter").loc[list(study.local.ranking)].reset_index()
    frame.insert(0, "rank", range(1, len(frame) + 1))
    return frame


def map_table(study: SensitivityStudy) -> Frame:
    """One row per motion: amplitude, frequency, every parameter's share, which is first, whether the claim holds."""
    amplitude, frequency = np.meshgrid(study.map.amplitudes, study.map.frequencies, indexing="ij")
    names = study.map.names
    shares = study.map.shares.reshape(-1, len(names))
    frame = pd.DataFrame({"amplitude": amplitude.ravel(), "frequency": frequency.ravel()})
    frame[list(names)] = shares
    frame["first"] = [ranked(row, names)[0] for row in shares]
    frame["claim"] = study.map.claim.ravel()
    return frame


def information_table(study: SensitivityStudy, expected: Expected) -> Frame:
    """One row per parameter of a measurement: expected standard error, that of the joint's fit, whether it is seen."""
    info = expected.information
    columns = (info.names, info.point.tolist(), info.standard_errors.tolist(), expected.seen.tolist())
    rows = [
        {
            "measurement": expected.what, "parameter": str(name), "value": value, "unit": unit(name.name, study.kind),
            "standard_error": error if seen else None, "percent": 100 * error / abs(value) if seen and value else None,
            "own_standard_error": expected.errors.get(name), "seen": seen,
        }
        for name, value, error, seen in zip(*columns, strict=True)
    ]  # fmt: skip  # a table
    return pd.DataFrame(rows).astype({"standard_error": object, "percent": object, "own_standard_error": object})


def sobol_table(sobol: Global, kind: Kind) -> Frame:
    """One row for each output and parameter: the interval drawn from, both indices with their half-widths, samples."""
    rows = [
        {
            "output": output_name(output.name, kind), "parameter": str(drawn.parameter), "lower": drawn.low, "upper": drawn.high,
            "unit": unit(drawn.parameter.name, kind), "drawn": "log-uniform" if drawn.logarithmic else "uniform",
            "first": effect.first, "first_half": effect.first_half, "total": effect.total, "total_half": effect.total_half,
            "samples": output.indices.samples, "evaluations": output.indices.evaluations,
        }
        for output in sobol.outputs if output.indices is not None
        for drawn, effect in zip(sobol.spans, output.indices.effects, strict=True)
    ]  # fmt: skip  # a list of values
    return pd.DataFrame(rows)
