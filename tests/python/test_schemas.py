"""What the commands print with --json is what their published schemas say, and nothing else."""

import contextlib
import gzip
import json
import math
import pathlib
import random
import subprocess
import tempfile
import unittest

from harness import BINARIES, FRAMES, ROOT, Graph, vigil, wait_for
from schemas import SCHEMAS, problems


@contextlib.contextmanager
def followed(*words):
    """What a command prints that goes on until it is ended."""
    with subprocess.Popen([BINARIES / "vigil", *words], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout
        finally:
            process.terminate()


class Documents(unittest.TestCase):
    """Checks documents by the schemas."""

    def check(self, name, *documents):
        self.assertGreater(len(documents), 0, name)
        self.assertEqual(problems(name, *documents), [], name)

    def printed(self, name, *words):
        """The document that a command prints, which is as the schema of this name says."""
        said = vigil(*map(str, words), "--json")
        self.assertIn(said.returncode, (0, 1), said.stderr)
        document = json.loads(said.stdout)
        self.check(name, document)
        return document

    def folder(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        return pathlib.Path(folder.name)


class OfGraphs(Documents):
    def document(self, name, *options):
        return self.printed(name, name, *options)

    def test_what_is_printed_without_a_graph(self):
        self.document("check", "--graph", "py-schemas")
        self.document("config", "--rate", "50")
        self.document("list")
        listen = ["--graph", "py-schemas", "--source", "external"]
        self.document("check-publisher", *listen, "--duration", "0.3")
        self.document("record", *listen, "--duration", "0.3", "--out", self.folder() / "frames.csv")

    def test_what_is_printed_of_a_running_graph_and_at_its_end(self):
        with Graph("--inject", "stuck:RM@2", "--inject", "encoder:LF:zero@5", "--duration", "60") as graph:
            graph.wait_until_up()
            told = "LF_ENC is active"
            wait_for(lambda: told in vigil("events", "--graph", graph.name).stdout, told)
            events = vigil("events", "--json", "--graph", graph.name).stdout.splitlines()
            self.check("events", *map(json.loads, events))
            kinds = {json.loads(event)["event"] for event in events}
            self.assertLessEqual({"alarm", "diagnosis", "weighed", "reason", "fault"}, kinds)
            self.document("faults", "--graph", graph.name)
            self.document("status", "--graph", graph.name)
            self.printed("status", "top", "--once", "--graph", graph.name)
            with followed("faults", "--follow", "--json", "--graph", graph.name) as faults:
                self.check("faults", json.loads(faults.readline()))
            self.document("list")
            self.check("run", graph.stop())

    def test_a_key_that_no_schema_names_is_found(self):
        document = {"schema_version": 1, "graphs": [], "more": 1}
        self.assertEqual(len(problems("list", document)), 1)


TIGER = """discount: 0.95 values: reward states: left right actions: listen open-left open-right
observations: hear-left hear-right
T: listen identity T: open-left uniform T: open-right : left 0.5 0.5 T: open-right : right 0.5 0.500004
O: listen 0.85 0.15 0.15 0.85 O: open-left uniform O: open-right uniform
R: listen : * : * : * -1 R: open-left : left : * : * -100 R: open-left : right : * : * 10
R: open-right : left : * : * 10 R: open-right : right : * : * -100
"""
# Left with 3/4, else right; a look costs 1 and never misses.
SEARCH = """discount: 1 values: cost states: left right found actions: look-left look-right
observations: nothing it start: 0.75 0.25 0
T: * identity T: look-left : left 0 0 1 T: look-right : right 0 0 1
O: * : * 1 0 O: * : found 0 1 R: * : left : * : * 1 R: * : right : * : * 1
"""


class OfDecisionModels(Documents):
    def pomdp(self, command, *words):
        return self.printed(f"pomdp-{command}", "pomdp", command, *words)

    def setUp(self):
        self.at = self.folder()
        self.tiger, self.search = self.at / "tiger.pomdp", self.at / "search.pomdp"
        self.tiger.write_text(TIGER)
        self.search.write_text(SEARCH)
        self.policy = self.at / "tiger.json"

    def simulated(self, episodes):
        missions = self.at / f"{episodes}.jsonl"
        words = ["--policy", "random", "--episodes", episodes, "--out", missions]
        said = vigil("pomdp", "simulate", *map(str, [self.tiger, *words]))
        self.assertEqual(said.returncode, 0, said.stderr)
        return missions

    def test_a_model_that_is_shown_and_converted(self):
        self.assertEqual(len(self.pomdp("info", self.tiger)["warnings"]), 1)
        self.pomdp("info", self.search)
        self.assertEqual(len(self.pomdp("convert", self.tiger, "--out", self.at / "again.pomdp")["warnings"]), 1)

    def test_a_model_that_is_solved_and_its_policy(self):
        self.assertIsNone(self.pomdp("solve", self.tiger, "--method", "fib")["lower"])
        self.pomdp("solve", self.tiger, "--precision", "0.01", "--out", self.policy)
        self.pomdp("value", self.tiger, self.policy, "--episodes", "50")
        searching = self.at / "search.json"
        self.pomdp("solve", self.search, "--precision", "0.01", "--out", searching)
        valued = self.pomdp("value", self.search, searching, "--episodes", "50", "--beliefs-max", "1")
        self.assertIsNone(valued["lower"])
        steps = ["--steps", "listen:hear-left,listen:hear-right"]
        self.pomdp("track", self.tiger, *steps, "--policy-file", self.policy)
        self.assertEqual(self.pomdp("track", self.search, "--steps", "0:1,0:0")["impossible_steps"], 1)

    def test_policies_that_are_compared(self):
        self.pomdp("compare", self.tiger, "--policies", "mls,dm-mls,random", "--episodes", "20")
        ended = self.pomdp("compare", self.tiger, "--policies", "mls", "--episodes", "2", "--ends", "open-left")
        self.assertIsNone(ended["upper"])

    def test_what_is_learned_from_missions(self):
        words = ["--out", self.at / "learned.pomdp", "--episodes", "50", "--iterations", "5"]
        many, one = self.simulated(40), self.simulated(1)
        self.pomdp("learn", self.tiger, "--missions", many, *words, "--world", self.tiger)
        learned = self.pomdp("learn", self.tiger, "--missions", one, *words)
        self.assertIsNone(learned["logged_measured"]["half_width_95"])
        lines = map(json.loads, many.read_text().splitlines())
        silent = [{key: line[key] for key in line if key != "rewards"} for line in lines]
        many.write_text("\n".join(map(json.dumps, silent)))
        self.assertIsNotNone(self.pomdp("learn", self.tiger, "--missions", many, *words)["refused"])

    def test_chances_that_are_fitted(self):
        missions = self.at / "missions.jsonl"
        mission = {"actions": ["go_on"], "observations": ["STUCK_NEW"], "states": ["STUCK_NEW", "STUCK_NEW"]}
        lines = [{"format": "vigil-missions", "version": 1}, mission]
        missions.write_text("\n".join(map(json.dumps, lines)))
        fitted = self.pomdp("fit", "config/rover.recovery.toml", "--missions", missions)
        self.assertGreater(len(fitted["chances"]), 0)

    def test_missions_that_are_gathered_from_a_run(self):
        step = {"number": 1, "belief": 0, "action": "FP", "observation": "none"}
        event = {"t_s": 1.0, "service": "supervisor", "event": "step", "what": "", "step": step}
        run = self.at / "run.json"
        run.write_text(json.dumps({"schema_version": 1, "graph": "corridor", "events": [event]}))
        words = ["--model", "config/navigation.pomdp", "--out", self.at / "missions.jsonl"]
        self.assertEqual(self.pomdp("missions", run, *words)["steps"], 1)


class OfLogs(Documents):
    def drive(self, path):
        """A minute of a differential robot: wheels of 0.1 m, 0.5 m apart."""
        chance = random.Random(1)
        rows = ["t_ms,v_cmd,omega_cmd,gyro_z,wheel_vel_left,wheel_vel_right"]
        for i in range(3000):
            t_s = 0.02 * i
            v, w = 0.4 * math.sin(0.3 * t_s), 0.8 * math.sin(0.17 * t_s)
            left, right = (10 * (v + y * w) + chance.gauss(0, 0.03) for y in (-0.25, 0.25))
            rows.append(f"{20 * i},{v},{w},{w + chance.gauss(0, 0.005)},{left},{right}")
        path.write_text("\n".join(rows) + "\n")

    def test_a_log_that_is_looked_at_described_imported_and_learned_from(self):
        at = self.folder()
        self.drive(at / "drive.csv")
        self.printed("import-look", "import", "--look", at / "drive.csv")
        self.printed("import-suggest", "import", "--suggest", at / "drive.csv", "--out", at / "mine")
        log = ["--log", at / "mine-log.toml", "--from", at, "--out", at / "frames.csv"]
        self.assertGreater(len(self.printed("import", "import", *log)["agreements"]), 0)
        frames = ["--robot", at / "mine-robot.toml", "--frames", at / "frames.csv"]
        learned = self.printed("learn-channels", "learn", *frames, "--out", at / "model.toml")
        self.assertGreater(len(learned["isolability"]["faults"]), 0)
        self.printed("init", "init", at / "my_robot", "--from", at / "drive.csv")

    def test_runs_of_declared_faults_and_contexts(self):
        at = self.folder()
        (at / "robot.toml").write_text(
            'name = "cart"\nkinematics = "none"\ncommand = []\n'
            "measured = { pose = false, wheel_rates = false, steer = false }\n"
            'channel = [{ name = "a" }, { name = "b" }]\n'
            'context = [{ name = "ground" }]\nfault = [{ name = "engine" }]\n'
        )
        chance = random.Random(1)
        frames, labels = ["run,t,a,b"], ["run,mode,onset_s,group"]
        steps = {"ground": (0.04, 0.03), "engine": (-0.05, 0.05), "ND": (0, 0)}
        for run in range(9):
            mode, onset_s = (["ground", "engine"][run % 2], 10) if run < 8 else ("ND", -1)
            labels.append(f"{run},{mode},{onset_s},day {run // 2 % 2}")
            for i in range(400):
                a, b = (1 + step + chance.gauss(0, 0.05) for step in steps[mode if i >= 200 else "ND"])
                frames.append(f"{run},{0.05 * i:.2f},{a:.5f},{b:.5f}")
        (at / "frames.csv").write_text("\n".join(frames) + "\n")
        (at / "labels.csv").write_text("\n".join(labels) + "\n")
        inputs = ["--robot", at / "robot.toml", "--frames", at / "frames.csv", "--runs", at / "labels.csv"]
        out = ["--test-fraction", "0", "--out", at / "model.toml"]
        learned = self.printed("learn-channels", "learn", *inputs, *out, "--cross-validate")
        self.assertEqual((len(learned["faults"]), len(learned["contexts"])), (1, 1))
        scored = self.printed("evaluate", "evaluate", *inputs, "--model", at / "model.toml", "--part", "all")
        self.assertIn("engine", scored["identification"])


class OfTheRover(Documents):
    MODEL, RUNS = "config/models/rover.toml", FRAMES.with_name("learn_runs.csv")

    def frames(self, keep):
        """The recorded runs that `keep` wants, as a file."""
        path = self.folder() / "frames.csv"
        with gzip.open(FRAMES, "rt") as file:
            head, *rows = file
        path.write_text(head + "".join(row for row in rows if keep(int(row.split(",")[0]))))
        return path

    def test_models_that_are_shown(self):
        self.printed("learn-show", "learn", "--show", "--model", self.MODEL)
        self.printed("learn-show-channels", "learn", "--show", "--model", "config/models/kobuki.toml")

    def test_a_model_that_is_learned(self):
        frames = self.frames(lambda run: run % 11 == 0)
        words = ["--frames", frames, "--runs", self.RUNS, "--out", self.folder() / "model.toml"]
        self.assertGreater(len(self.printed("learn", "learn", *words)["modes"]), 1)

    def test_a_diagnosis_that_is_scored(self):
        frames = self.frames(lambda run: run in (2, 3, 103, 400))
        words = ["--model", self.MODEL, "--frames", frames, "--runs", self.RUNS, "--part", "all"]
        scored = self.printed("evaluate", "evaluate", *words, "--filters", "bootstrap")
        self.assertEqual(sorted(scored["filters"]), sorted(scored["sensor_sets"]))


class Published(unittest.TestCase):
    def test_every_schema_is_listed_and_printed_by_the_program_that_has_it(self):
        names = vigil("schema").stdout.split()
        self.assertEqual(sorted(f"{name}.json" for name in names), sorted(path.name for path in SCHEMAS.iterdir()))
        for name in ["status", "pomdp-solve"]:
            self.assertEqual(vigil("schema", name).stdout, (SCHEMAS / f"{name}.json").read_text())
        unknown = vigil("schema", "pomdp")
        self.assertEqual((unknown.returncode, "there are: run, " in unknown.stderr), (2, True))

    def test_what_was_measured_is_as_its_schema_says(self):
        bench = ROOT / "bench"
        said = subprocess.run([BINARIES / "vigil-bench", "size", "--json"], capture_output=True, text=True, cwd=ROOT)
        self.assertEqual(said.returncode, 0, said.stderr)
        kept = [path.read_text() for path in sorted((bench / "results").rglob("*.json"))]
        results = [json.loads(text) for text in [said.stdout, *kept]]
        self.assertGreater(len(results), 10)
        self.assertEqual(problems("result.schema", *results, folder=bench), [])

    def test_all_schemas_are_written_by_one_command(self):
        with tempfile.TemporaryDirectory() as folder:
            said = vigil("schema", "--out", folder)
            self.assertEqual(said.returncode, 0, said.stderr)
            written = {path.name: path.read_text() for path in pathlib.Path(folder).iterdir()}
        self.assertEqual(written, {path.name: path.read_text() for path in SCHEMAS.iterdir()})


if __name__ == "__main__":
    unittest.main()
