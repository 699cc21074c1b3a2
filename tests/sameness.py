"""What results hold, whatever their sentences are."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np
import pytest

from bristle.diagnostics import Diagnostic, Kind
from bristle.model.laws.parts import Law


def without_sentences(patch: pytest.MonkeyPatch) -> None:
    """Make every template the name of its kind, as if all sentences had been worded anew."""
    for kind in Kind:
        patch.setattr(kind, "template", kind.name)


def of_kind(diagnostics: Iterable[Diagnostic], *kinds: Kind) -> list[Diagnostic]:
    """Those of these kinds."""
    return [d for d in diagnostics if d.kind in kinds]


def held(result: Any) -> list[str]:
    """Numbers, words, kinds and severities of a result, a line each; sentences are made from those, and are not among them."""
    return json.dumps(_plain(result), indent=1).splitlines()


def _plain(x: Any) -> Any:
    if isinstance(x, Diagnostic):
        return [x.kind.name, x.severity, _plain(x.numbers)]
    if isinstance(x, Enum | Law):
        return x.name
    if is_dataclass(x):
        return {item.name: _plain(getattr(x, item.name)) for item in fields(x) if item.compare}
    if isinstance(x, Mapping):
        return {str(key): _plain(value) for key, value in x.items()}
    if isinstance(x, np.ndarray):
        return x.tolist()
    return [_plain(item) for item in x] if isinstance(x, tuple | list) else x
