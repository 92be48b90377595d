"""What the commands print with --json is what their published schemas say, and nothing else."""

import json
import tempfile
import time
import unittest

import jsonschema
from harness import ROOT, WATCHDOG_S, Graph, vigil

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


def validator(name):
    schema = json.loads((SCHEMAS / f"{name}.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(closed(schema))


class Schemas(unittest.TestCase):
    def check(self, name, *documents):
        of_name = validator(name)
        for document in documents:
            wrong = [f"{error.json_path}: {error.message}" for error in of_name.iter_errors(document)]
            self.assertEqual(wrong, [], name)
        self.assertGreater(len(documents), 0, name)

    def document(self, name, *options):
        said = vigil(name, *options, "--json")
        self.assertIn(said.returncode, (0, 1), said.stderr)
        self.check(name, json.loads(said.stdout))

    def file(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        return f"{folder.name}/frames.csv"

    def test_what_is_printed_without_a_graph(self):
        self.document("check", "--graph", "py-schemas")
        self.document("config", "--rate", "50")
        self.document("list")
        listen = ["--graph", "py-schemas", "--source", "external"]
        self.document("check-publisher", *listen, "--seconds", "0.3")
        self.document("record", *listen, "--seconds", "0.3", "--out", self.file())

    def test_what_is_printed_of_a_running_graph_and_at_its_end(self):
        with Graph("--inject", "stuck:RM@2", "--inject", "encoder:LF:zero@5", "--duration", "60") as graph:
            graph.wait_until_up()
            until = time.monotonic() + WATCHDOG_S
            while "LF_ENC is active" not in vigil("events", "--graph", graph.name).stdout:
                self.assertLess(time.monotonic(), until)
                time.sleep(0.2)
            events = vigil("events", "--json", "--graph", graph.name).stdout.splitlines()
            self.check("events", *map(json.loads, events))
            kinds = {json.loads(event)["event"] for event in events}
            self.assertLessEqual({"alarm", "diagnosis", "weighed", "reason", "fault"}, kinds)
            self.document("faults", "--graph", graph.name)
            self.document("status", "--graph", graph.name)
            self.document("list")
            self.check("run", graph.stop())

    def test_a_key_that_no_schema_names_is_found(self):
        document = {"schema_version": 1, "graphs": [], "more": 1}
        self.assertEqual(len(list(validator("list").iter_errors(document))), 1)


if __name__ == "__main__":
    unittest.main()
