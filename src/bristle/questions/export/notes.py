"""What an artefact says of itself in its comments: where its numbers are from, how far to trust them, what was assumed, and what is lost."""

from collections.abc import Iterator, Sequence

from bristle.model.laws.gaussian import GAUSSIAN
from bristle.page.wording import measured, span
from bristle.questions.export.exported import ExportedJoint, ExportedParameter
from bristle.questions.export.loss import Loss, told


def notes(joint: ExportedJoint, found: Sequence[Loss] = ()) -> Iterator[str]:
    """One line each, unescaped: provenance, trust, parameters with their intervals, what was assumed, and losses."""
    origin = joint.origin
    yield f"joint {joint.name} ({joint.kind}), identified by bristle {origin.bristle}"
    if joint.law_name != GAUSSIAN.name:
        yield f"friction law: {ascii(joint.law_name)[1:-1]}"
    if joint.simulated:
        yield "SIMULATED: the joint was identified from simulated data"
    yield f"results.json: sha256 {origin.results_sha256 or 'none, exported without a file'}"
    yield f"experiment: {origin.experiment or 'not known'}, {len(origin.logs)} logs"
    yield f"{joint.trust}" + (f": {joint.reason}" if joint.reason else "")
    for row in joint.parameters:
        yield _parameter(row)
    if found:
        yield f"torque RMS error: {told(found, joint)}"
    for said in joint.said:
        yield f"{said.severity}: {said}"


def _parameter(row: ExportedParameter) -> str:
    value = f"{row.parameter} = {measured(row.value, row.standard_error).replace('±', '+/-')} {row.unit}"
    if row.interval is None:
        return f"{value}, {'ASSUMED' if row.assumed else row.source}"
    return f"{value}, 95 % {span(row.interval).replace('∞', 'inf')}, from {row.source}"
