"""What results hold, whatever their sentences are."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np
import pytest

from bristle.findings import Finding, Severity
from bristle.model.laws.parts import Law


def without_sentences(patch: pytest.MonkeyPatch) -> None:
    """Make every message the finding's code, as if all had been worded anew."""
    made = Finding.__init__

    def bare(x: Finding, code: str, severity: Severity, message: str, *more: Any, **named: Any) -> None:
        made(x, code, severity, code if message else "", *more, **named)

    patch.setattr(Finding, "__init__", bare)


def of_kind(diagnostics: Iterable[Finding], *kinds: str) -> list[Finding]:
    return [d for d in diagnostics if d.code in kinds]


def held(result: Any) -> list[str]:
    """Numbers, words, kinds and severities of a result, a line each; sentences are made from those, and are not among them."""
    return json.dumps(_plain(result), indent=1).splitlines()


def _plain(x: Any) -> Any:
    if isinstance(x, Finding):
        return [x.code, x.severity, _plain(x.numbers)]
    if isinstance(x, Enum | Law):
        return x.name
    if is_dataclass(x):
        return {item.name: _plain(getattr(x, item.name)) for item in fields(x) if item.compare}
    if isinstance(x, Mapping):
        return {str(key): _plain(value) for key, value in x.items()}
    if isinstance(x, np.ndarray):
        return x.tolist()
    return [_plain(item) for item in x] if isinstance(x, tuple | list) else x
