"""The published schemas of what commands print with --json, and what in a document is not as they say."""

import json

import jsonschema
from harness import ROOT

SCHEMAS = ROOT / "docs" / "schemas"


def closed(schema):
    """The schema without room for keys that it does not name: a new key needs its description."""
    if isinstance(schema, list):
        return [closed(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    schema = {key: closed(value) for key, value in schema.items()}
    if isinstance(schema.get("properties"), dict):
        schema.setdefault("additionalProperties", False)
    return schema


def problems(name, *documents, folder=SCHEMAS):
    """Where the documents are not what the schema of this name says, and nothing else."""
    schema = json.loads((folder / f"{name}.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(closed(schema))
    errors = [error for document in documents for error in validator.iter_errors(document)]
    return [f"{error.json_path}: {error.message}" for error in errors]
