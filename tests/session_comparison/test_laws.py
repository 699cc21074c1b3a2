from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.model.laws.registry import law_named
from bristle.questions.session_comparison.compare import compare
from bristle.questions.session_comparison.results import Comparison, Session, alike, session_of

from ..conftest import speeds, write
from ..laws import DRAG, EXPONENT, OUTSIDE, points, registered, truth_of
from ..pages import page_text


@pytest.fixture(autouse=True, scope="module")
def known() -> Iterator[None]:
    with registered():
        yield


@cache
def session(law: str, of: str = "", seed: int = 0, **changed: float) -> Session:
    """Points of a joint `of` a law, else that of the fit, with some of its parameters others, fitted under a law."""
    truth = truth_of(of or law)._replace(**changed)
    return session_of([points(law, truth, seed).joint])


def names(found: Comparison, *, compared: bool) -> set[str]:
    """The parameters that were compared, or those that could not be."""
    return {str(c.parameter) for c in found.changes if (c.changed is not None) is compared}


@pytest.mark.parametrize("law", [DRAG, EXPONENT, OUTSIDE])
def test_sessions_of_one_law_are_compared_in_all_its_parameters(law: str) -> None:
    """All that the law estimates is compared, alone and as a set, and nothing changed; v_end is no estimate."""
    found = compare(session(law), session(law, seed=1))
    own = {"alpha_0", "alpha_1", "alpha_2", *law_named(law).shape_parameters, *law_named(law).coefficients}
    assert names(found, compared=True) == own
    assert not names(found, compared=False)
    assert {str(name) for name in found.sets[0].names} == own
    assert not any(c.changed for c in found.changes)
    assert not any(x.code == "laws-differ" for x in found.warnings)


def test_what_is_compared_under_two_laws(tmp_path: Path) -> None:
    """Where alpha_3 alone is another, it changed, by as much."""
    found = compare(session(DRAG), session(DRAG, seed=1, alpha_3=-0.004))
    (change,) = (c for c in found.changes if c.parameter.name == "alpha_3")
    assert change.changed
    assert change.difference == pytest.approx(0.004, rel=0.2)
    # breakaway is compared, what each law alone defines is not, and no cause is named; one sentence says so and what to do
    found = compare(session("paper", of=DRAG), session(DRAG))
    assert names(found, compared=True) == {"breakaway"}
    assert names(found, compared=False) == {"alpha_0", "alpha_1", "alpha_2", "v_s", "alpha_3"}
    reasons = {str(c.verdict) for c in found.changes if c.changed is None}
    assert reasons == {"Not comparable: it means another thing in the law of each session."}
    assert "torque-scale" not in [x.code for x in found.warnings]
    (told,) = (x for x in found.warnings if x.code in ("laws-differ", "models-differ"))
    assert told.code == "laws-differ"
    assert f"law: {DRAG}" in str(told)
    # one curve under two peaks: nothing changed, though alpha_0 of the one is not alpha_0 of the other
    found = compare(session("paper"), session(EXPONENT, of="paper", seed=1))
    assert names(found, compared=True) == {"breakaway"}
    assert not any(c.changed for c in found.changes)
    # its variance is that of alpha_0 and alpha_1 with their covariance; a joint that breaks away elsewhere has changed
    fit = points("paper").joint.static["both"]
    at = [fit.names.index(name) for name in ("alpha_0", "alpha_1")]
    found = compare(session("paper"), session(EXPONENT, of="paper", seed=1, alpha_1=0.008))
    (change,) = (c for c in found.changes if c.parameter.name == "breakaway")
    assert change.first is not None
    assert change.first.value == pytest.approx(sum(fit.parameters[n].value or 0.0 for n in ("alpha_0", "alpha_1")))
    assert change.first.standard_error == pytest.approx(np.sqrt(fit.covariance[np.ix_(at, at)].sum()))
    assert change.changed
    assert change.difference == pytest.approx(0.0025, rel=0.2)
    # no parameter of the curve means the same in two laws, even of one peak; sigma_0, sigma_1 and the inertia always do
    a, b = law_named("lorentzian"), law_named(DRAG)
    assert all(alike(name, a, b) for name in ("sigma_0", "sigma_1", "inertia", "offset"))
    assert not any(alike(name, a, b) for name in ("alpha_0", "alpha_1", "alpha_2", "alpha_3", "v_s"))
    assert not alike("delta", law_named("paper"), law_named(EXPONENT))
    assert alike("alpha_0", b, b)
    # two results files of two laws give the same, and the page says that the laws differ
    paths = [write(tmp_path / stem, speeds(), stem=stem) for stem in ("first", "second")]
    paths[1].write_text(paths[1].read_text() + f"fit: {{law: {DRAG}}}\n")
    files = [path.parent / "results.json" for path in paths]
    for path, file in zip(paths, files, strict=True):
        file.write_text(bristle.identify(path).to_json(), encoding="utf-8")
    found = bristle.compare(*files)
    assert {name.rstrip("+-") for name in names(found, compared=True)} == {"breakaway"}
    assert "has the friction law gaussian" in page_text(bristle.report_of(found).write(tmp_path / "page"))
