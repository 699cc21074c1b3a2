"""YAML to a validated model; errors say where in the file, what was got and what was expected."""

import difflib
from collections.abc import Hashable, Iterator
from pathlib import Path
from typing import Any, Self, TypeVar, get_args

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails

from bristle.errors import InputError, read_at_most, short

MAX_BYTES = 1_000_000  # largest experiment file, bytes
MAX_DEPTH = 30  # deepest nesting of an experiment file; ours has four levels
MAX_NODES = 10_000  # most keys, values and lists in an experiment file; a run has about ten
_DIGITS = 30  # most digits of an integer: Python refuses to write out far longer ones


class StrictModel(BaseModel):
    """A part of the experiment file: frozen, and closed to unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)

    @model_validator(mode="after")
    def _goes_together(self) -> Self:
        for problem in self._problems():
            raise InputError(problem)
        return self

    def _problems(self) -> Iterator[str]:
        """Contradictions between valid parts, of which the first is raised."""
        return iter(())


M = TypeVar("M", bound=StrictModel)


class _RefusedError(yaml.MarkedYAMLError):
    """YAML that is well formed and not taken; its problem is a whole sentence."""


class _Loader(yaml.SafeLoader):
    """YAML without aliases, which a few bytes can blow up to any size, and without repeated keys."""

    depth = nodes = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """One node of the document.

        Raises yaml.MarkedYAMLError at an anchor, an alias, too deep a nesting, or too many nodes.
        """
        event, problem = self.peek_event(), ""  # type: ignore[no-untyped-call]  # types-PyYAML leaves the parser untyped
        self.depth += 1
        self.nodes += 1
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            problem = "anchors (&) and aliases (*) are not allowed; write the value out"
        elif self.depth > MAX_DEPTH:
            problem = "nested too deeply; expected a few levels"
        elif self.nodes > MAX_NODES:
            problem = f"more than {MAX_NODES} keys and values; expected an experiment file, which is a page of YAML (runs may be a glob)"
        if problem:
            raise _RefusedError(problem=problem, problem_mark=event.start_mark)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """A mapping. Raises yaml.MarkedYAMLError where a key is repeated."""
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value in seen:
                problem = f"key {short(key.value)} is given twice; keep one of them"
                raise _RefusedError(problem=problem, problem_mark=key.start_mark)
            seen.add(str(key.value))
        return super().construct_mapping(node, deep=deep)

    def construct_integer(self, node: yaml.ScalarNode) -> int:
        """A short integer. Raises yaml.MarkedYAMLError where it is long."""
        if len(node.value) > _DIGITS:
            problem = f"an integer of {len(node.value)} digits; expected at most {_DIGITS}, or text in quotes"
            raise _RefusedError(problem=problem, problem_mark=node.start_mark)
        return int(self.construct_yaml_int(node))


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_integer)


def read_text(path: Path) -> str:
    """The text of a regular file of at most `MAX_BYTES`. Raises InputError where it cannot be read."""
    content = read_at_most(path, MAX_BYTES, "an experiment file, which is a page of YAML")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        why = f"not text in UTF-8 (byte {error.start})"
        raise InputError(f"{path}: {why}; expected an experiment file in YAML") from error


def parse(text: str, name: str) -> dict[str, Any]:
    """The mapping of a YAML text. Raises InputError with the line where it is malformed."""
    try:
        loader = _Loader(text)
        document = loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f" line {mark.line + 1}, column {mark.column + 1}:" if mark else ""
        problem = str(error.problem or error.context)
        if not isinstance(error, _RefusedError):
            there = "".join(text.splitlines()[mark.line : mark.line + 1]).strip() if mark else ""
            got = f"got {short(there) if there else 'the end of the file'}, which is not YAML ({problem})"
            problem = f"{got}; check its indentation, colons, brackets and quotes"
        raise InputError(f"{name}:{where} {problem}") from error
    except yaml.YAMLError as error:
        raise InputError(f"{name}: not YAML: {' '.join(str(error).split())}") from error
    except (ValueError, TypeError, LookupError, OverflowError, AttributeError) as error:  # as seen from PyYAML
        raise InputError(f"{name}: holds a value that YAML cannot read ({error}); put it in quotes") from error
    if not isinstance(document, dict):
        expected = "keys such as joint:, signals: and runs: (bristle new drafts them from a log)"
        raise InputError(f"{name}: got {short(document)}; expected {expected}")
    return document


def validate(model: type[M], data: dict[str, Any], name: str, context: object) -> M:
    """The model of the data. Raises InputError with the key, what was got and what to do."""
    try:
        return model.model_validate(data, context=context)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        parents = {e["loc"][:k] for e in errors for k in range(len(e["loc"]))}
        # pydantic calls a sequence short whose items it refused
        causes = [e for e in errors if e["loc"] not in parents]
        first = min(causes, key=lambda e: e["type"] != "extra_forbidden")  # a misspelt key explains a missing one
        more = f" (and {len(causes) - 1} more)" if len(causes) > 1 else ""
        raise InputError(f"{name}: {_sentence(first, model)}{more}") from error


_EXPECTED = {  # by the kind of pydantic's error
    "too_short": "at least one entry", "invalid_key": "a key that is text, in quotes", "tuple_type": "a list, as [1, 2]",
}  # fmt: skip  # a table


def _sentence(error: ErrorDetails, model: type[BaseModel]) -> str:
    unknown = error["type"] == "extra_forbidden"
    tags = () if unknown else ("int", "str", "bool", "float")
    key = ".".join(str(part)[:60] for part in error["loc"] if part not in tags)
    if unknown:
        known = _known(model, error["loc"][:-1])
        near = difflib.get_close_matches(str(error["loc"][-1])[:60], known, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"expected one of {', '.join(known)}"
        return f"unknown key {short(key)}; {hint}"
    if error["type"] == "missing":
        return f"{key}: missing; add this key"
    if error["type"] == "value_error":
        sentence = str(error["ctx"]["error"])
        return f"{key}: {sentence}" if key and not sentence.startswith(f"{key}.") else sentence
    if error["type"] in ("model_type", "model_attributes_type"):
        return f"{key}: got {short(error['input'])}; expected keys with values, of {', '.join(_known(model, error['loc']))}"
    message = _EXPECTED.get(error["type"]) or error["msg"].removeprefix("Input should be ").removeprefix("a valid ")
    message = message.removeprefix("String should have ")
    return f"{key}: got {short(error['input'])}; expected {message}"


def _known(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    """The keys of the model at a path."""

    def inside(annotation: object) -> type[BaseModel] | None:
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            return annotation
        return next(filter(None, map(inside, get_args(annotation))), None)

    for part in path:
        field = next((f for n, f in model.model_fields.items() if part in (n, f.alias)), None)
        model = model if field is None else inside(field.annotation) or model
    return [field.alias or name for name, field in model.model_fields.items() if name != "path"]
