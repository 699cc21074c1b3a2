"""YAML of schema bristle-export/1: the document of JSON, to be read by people as well."""

import json
from collections.abc import Sequence
from typing import Any

from bristle.data.experiment.yaml_file import parse
from bristle.questions.export.artefact import Artefact, ExportTarget, Request, slug
from bristle.questions.export.document_schema import as_values, joints_in
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.json_document import HOLDS_ALL, told_back, validated


def write_yaml(joints: Sequence[ExportedJoint], request: Request) -> Artefact:  # noqa: ARG001  # nothing is lost along any motion
    """The document as YAML, in ASCII; every float keeps every digit."""
    import yaml

    class Plain(yaml.SafeDumper):
        def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002  # whatever it is
            """Everything is written out: bristle reads no alias."""
            return True

    text = yaml.dump(as_values(joints), Dumper=Plain, sort_keys=False, allow_unicode=False, width=2**20)
    return Artefact(name=f"{slug(joints)}_friction.yaml", content=text.encode("ascii"), holds=HOLDS_ALL)


def check_yaml(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:  # noqa: ARG001  # whatever is asked
    """Validates the document by the schema of JSON, and reads it back."""
    values = parse(artefact.content.decode(), artefact.name)
    return validated(values), told_back(joints_in(json.dumps(values)), joints)


TARGET = ExportTarget(write=write_yaml, check=check_yaml, loaded=True)
