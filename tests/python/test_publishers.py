"""Publishers of examples/ drive real graphs, which find the fault that was recorded."""

import contextlib
import csv
import ctypes
import gzip
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

from harness import BINARIES, EXAMPLES, FRAMES, ROOT, STUCK_LEAF, STUCK_RUN, Graph, events, publisher, vigil

import vigil_types

# The recording's own: capture times that run ahead of the clock are no clock.
RATE_HZ = 20
# Asks for what examples/CMakeLists.txt needs, and for nothing else.
BINDING = """cmake_minimum_required(VERSION 3.22)
project(binding LANGUAGES CXX)
find_package(iceoryx2-cxx 0.10.0 EXACT REQUIRED)
"""


class Publishers(unittest.TestCase):
    def assert_found(self, summary, border):
        self.assertTrue(events(summary, "alarm"), summary["events"])
        self.assertIn(STUCK_LEAF, events(summary, "diagnosis"))
        self.assertEqual(summary["services"][border]["rejected"], {})
        self.assertEqual(summary["services"][border]["lost"], 0)

    def run_to_its_end(self, process):
        _, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0, errors)

    def test_python_through_shared_memory(self):
        with Graph("--source", "external", "--rate", str(RATE_HZ)) as graph:
            self.run_to_its_end(publisher("publisher.py", FRAMES, STUCK_RUN, graph.name, RATE_HZ))
            self.assert_found(graph.stop(), "detector")

    def test_rust_through_shared_memory(self):
        with Graph("--source", "external", "--rate", "20") as graph:
            command = [BINARIES / "publisher", FRAMES, str(STUCK_RUN), graph.name]
            pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
            self.run_to_its_end(subprocess.Popen(command, cwd=ROOT, text=True, **pipes))
            self.assert_found(graph.stop(), "detector")

    def test_python_through_the_unix_socket(self):
        # At the recording's own rate: due times are found from its capture times.
        with Graph("--source", "socket", "--rate", "20") as graph:
            socket = graph.wait_for_socket()
            command = [sys.executable, EXAMPLES / "socket_publisher.py", FRAMES, str(STUCK_RUN), socket, "20"]
            heard = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=True).stdout
            self.assert_found(graph.stop(), "sensor-sim")
        # What the graph decided came back to the sender.
        self.assertIn("go_on, ND", heard)
        self.assertIn(STUCK_LEAF, heard)

    def rows(self):
        """Rows of the recorded run, as the C++ publishers read them."""
        rows = subprocess.run(["zcat", FRAMES], check=True, capture_output=True, text=True).stdout
        return "".join(row + "\n" for row in rows.split("\n") if row.startswith(f"{STUCK_RUN},"))

    def feed(self, *command):
        options = {"cwd": ROOT, "text": True, "check": True, "timeout": 60}
        return subprocess.run(command, input=self.rows(), stdout=subprocess.PIPE, **options).stdout

    def test_cpp_through_udp(self):
        with tempfile.TemporaryDirectory() as folder:
            program = pathlib.Path(folder) / "publisher"
            flags = ["-std=c++17", "-O1", "-Wall", "-Wextra", f"-I{EXAMPLES}"]
            subprocess.run(["c++", *flags, EXAMPLES / "socket_publisher.cpp", "-o", program], check=True)
            with Graph("--source", "socket", "--rate", "20") as graph:
                graph.wait_for_socket()
                heard = self.feed(program, f"127.0.0.1:{graph.udp_port}")
                self.assert_found(graph.stop(), "sensor-sim")
        self.assertIn(STUCK_LEAF, heard)

    def has_binding(self, folder):
        """True if cmake finds iceoryx2's C++ binding."""
        probe = pathlib.Path(folder) / "binding"
        probe.mkdir()
        (probe / "CMakeLists.txt").write_text(BINDING)
        command = ["cmake", "-S", probe, "-B", probe / "build"]
        return shutil.which("cmake") is not None and subprocess.run(command, capture_output=True).returncode == 0

    def build(self, *command):
        done = subprocess.run(command, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_cpp_through_shared_memory(self):
        with tempfile.TemporaryDirectory() as folder:
            if not self.has_binding(folder):
                self.skipTest("cmake does not find iceoryx2's C++ binding (iceoryx2-cxx 0.10)")
            built = pathlib.Path(folder) / "built"
            self.build("cmake", "-S", EXAMPLES, "-B", built)
            self.build("cmake", "--build", built)
            with Graph("--source", "external", "--rate", "20") as graph:
                graph.wait_until_up()
                self.feed(built / "publisher", graph.name)
                self.assert_found(graph.stop(), "detector")

    def test_a_publisher_of_another_version_is_told_so(self):
        code = "import vigil_types as v; v.SensorFrame.TYPE_NAME = 'vigil.SensorFrame.v0.0123456789abcdef'\n"
        text = code + (EXAMPLES / "publisher.py").read_text()
        with Graph("--source", "external") as graph, tempfile.TemporaryDirectory() as folder:
            graph.wait_until_up()
            for name in ["joining.py", "recording.py", "vigil_types.py", "waiting.py"]:
                (pathlib.Path(folder) / name).write_text((EXAMPLES / name).read_text())
            file = pathlib.Path(folder) / "publisher.py"
            file.write_text(text)
            command = [sys.executable, file, FRAMES, str(STUCK_RUN), graph.name, "20"]
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 1)
            self.assertIn("the graph has vigil.SensorFrame.v1.", done.stderr)
            self.assertIn("this program has vigil.SensorFrame.v0.0123456789abcdef, 576 bytes", done.stderr)


class Record(unittest.TestCase):
    def test_what_a_publisher_sends_is_recorded_without_a_graph_or_a_model(self):
        with tempfile.TemporaryDirectory() as folder:
            config, frames = pathlib.Path(folder) / "config", pathlib.Path(folder) / "frames.csv.gz"
            shutil.copytree(ROOT / "config", config)
            (config / "models" / "rover.toml").unlink()
            name = f"py{os.getpid()}-record"
            graph = ["--config", config / "rover.toml", "--graph", name, "--source", "external", "--rate", "20"]
            process = publisher("publisher.py", FRAMES, STUCK_RUN, name, 20)
            try:
                done = vigil("record", *graph, "--out", frames, "--duration", "4", "--json")
            finally:
                process.terminate()
                process.communicate(timeout=20)
            self.assertEqual(done.returncode, 0, done.stderr)
            said = json.loads(done.stdout)
            self.assertEqual((said["runs"], said["refused"]), (1, {}))
            with gzip.open(frames, "rt") as file:
                recorded = list(csv.DictReader(file))
            with gzip.open(FRAMES, "rt") as file:
                sent = [row for row in csv.DictReader(file) if row["run"] == str(STUCK_RUN)]
        self.assertEqual(len(recorded), said["frames"])
        self.assertGreater(len(recorded), 40)
        # One after the other as they were sent, to the rounding of the file.
        first = [float(row["x"]) for row in sent].index(float(recorded[0]["x"]))
        for ours, theirs in zip(recorded, sent[first:]):
            for column in set(ours) & set(theirs) - {"run", "t"}:
                self.assertAlmostEqual(float(ours[column]), float(theirs[column]), delta=1e-6, msg=column)
            t_s = float(theirs["t"]) - float(sent[first]["t"])
            self.assertAlmostEqual(float(ours["t"]), t_s, delta=2e-6)

    def test_without_a_publisher_nothing_is_written(self):
        with tempfile.TemporaryDirectory() as folder:
            frames = pathlib.Path(folder) / "frames.csv"
            name = f"py{os.getpid()}-silent"
            done = vigil("record", "--graph", name, "--source", "external", "--out", frames, "--duration", "1")
            self.assertEqual((done.returncode, frames.exists()), (1, False), done.stderr)
            self.assertIn("no frame came", done.stdout)


class CheckPublisher(unittest.TestCase):
    def check(self, graph, *options):
        done = vigil("check-publisher", "--graph", graph, "--duration", "3", "--json", *options)
        document = json.loads(done.stdout)
        self.assertEqual(done.returncode, 0 if document["ok"] else 1)
        return document

    def status(self, document):
        return {finding["check"]: finding["status"] for finding in document["findings"]}

    def test_a_good_publisher_fits(self):
        with Graph("--source", "external", "--rate", str(RATE_HZ)) as graph:
            process = publisher("publisher.py", FRAMES, STUCK_RUN, graph.name, RATE_HZ)
            graph.wait_until_up()
            document = self.check(graph.name, "--source", "external", "--rate", str(RATE_HZ))
            self.run_it(process)
        found = self.status(document)
        self.assertTrue(document["ok"], document)
        self.assertEqual([found[check] for check in ["type", "frames", "refused", "rate", "gaps"]], 5 * ["ok"])

    def test_a_good_publisher_fits_where_there_is_no_graph(self):
        name = f"py{os.getpid()}-alone"
        process = publisher("publisher.py", FRAMES, STUCK_RUN, name, RATE_HZ)
        document = self.check(name, "--source", "external", "--rate", str(RATE_HZ))
        self.run_it(process)
        self.assertTrue(document["ok"], document)

    def test_beside_a_graph_it_knows_how_that_was_started(self):
        # At the recording's own rate: its capture times are right as well.
        with Graph("--source", "external", "--rate", "20") as graph:
            process = publisher("publisher.py", FRAMES, STUCK_RUN, graph.name, 20)
            graph.wait_until_up()
            document = self.check(graph.name)
            self.run_it(process)
        # Three seconds do not show all that a description says.
        judged = [found for found in document["findings"] if found["status"] != "unjudged"]
        self.assertEqual([found for found in judged if found["status"] != "ok"], [])
        self.assertIn("unjudged", self.status(document).values())

    def changed(self, file, before, after, where, rate_hz):
        """What is said of publisher.py where `before` in a file of examples/ is `after`; `where` runs it in a graph."""
        with contextlib.ExitStack() as stack:
            folder = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory()))
            for name in ["joining.py", "publisher.py", "recording.py", "vigil_types.py", "waiting.py"]:
                (folder / name).write_text((EXAMPLES / name).read_text())
            text = (folder / file).read_text()
            self.assertIn(before, text)
            (folder / file).write_text(text.replace(before, after))
            name = f"py{os.getpid()}-{file[:4]}"
            if where == "graph":
                graph = stack.enter_context(Graph("--source", "external", "--rate", str(rate_hz)))
                name = graph.name
            command = [sys.executable, folder / "publisher.py", FRAMES, str(STUCK_RUN), name, str(rate_hz)]
            process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
            if where == "graph":
                graph.wait_until_up()
            document = self.check(name, "--source", "external", "--rate", str(rate_hz))
            self.run_it(process)
        return document

    def test_an_epoch_for_each_frame_is_told(self):
        after = "    publisher._epoch += 1\n    publisher.publish"
        document = self.changed("publisher.py", "    publisher.publish", after, "graph", RATE_HZ)
        self.assertEqual(self.status(document)["starts"], "failure")
        self.assertEqual(self.status(document)["refused: other-writer"], "failure")

    def test_frames_without_a_notification_are_told_beside_a_graph_and_without_one(self):
        for where in ["graph", "alone"]:
            with self.subTest(where):
                document = self.changed("joining.py", "self._bell.notify()", "pass", where, RATE_HZ)
                (found,) = [f for f in document["findings"] if f["check"] == "notification"]
                self.assertEqual(found["status"], "failure")
                self.assertIn("frames arrive but no notification", found["detail"])

    def test_frames_in_bursts_are_told(self):
        # Five at once, at the right rate on the whole.
        after = "    publisher._seq % 5 == 4 and time.sleep"
        document = self.changed("publisher.py", "    time.sleep", after, "graph", RATE_HZ)
        (found,) = [f for f in document["findings"] if f["check"] == "bursts"]
        self.assertEqual(found["status"], "failure")
        self.assertIn("5 at once", found["detail"])

    def test_a_publisher_of_another_graph_name_is_told_which_graphs_run(self):
        with Graph("--source", "external", "--rate", str(RATE_HZ)) as graph:
            graph.wait_until_up()
            document = self.check(f"py{os.getpid()}-wrong", "--source", "external")
        (frames,) = [f for f in document["findings"] if f["check"] == "frames"]
        self.assertIn("Other graphs that run: ", frames["detail"])
        self.assertIn(graph.name, frames["detail"])

    def run_it(self, process):
        process.terminate()
        process.communicate(timeout=20)

    def test_another_type_is_told_by_size_hash_and_version(self):
        import iceoryx2

        class Other(ctypes.Structure):
            _fields_ = [("header", vigil_types.Header), ("speed", ctypes.c_double)]

            @staticmethod
            def type_name():
                return "vigil.SensorFrame.v1.0123456789abcdef"

        name = f"py{os.getpid()}-other"
        # Of a process that goes on, iceoryx2 leaves one file.
        self.addCleanup(lambda: [left.unlink() for left in pathlib.Path("/dev/shm").glob(f"vigil_{name}_*")])
        # Where a graph of this name would be: told when nobody publishes.
        (none,) = [f for f in self.check(name, "--source", "external")["findings"] if f["check"] == "frames"]
        config = iceoryx2.config.default()
        config.global_cfg.prefix = iceoryx2.FileName.new(f"vigil_{name}_")
        config.global_cfg.root_path = iceoryx2.Path.new(none["detail"].split("root path '")[1].split("'")[0])
        node = iceoryx2.NodeBuilder.new().config(config).create(iceoryx2.ServiceType.Ipc)
        topic = node.service_builder(iceoryx2.ServiceName.new(f"vigil/{name}/sensor"))
        held = topic.publish_subscribe(Other).open_or_create()
        document = self.check(name, "--source", "external")
        del held, topic, node
        (found,) = [f for f in document["findings"] if f["check"] == "type"]
        self.assertEqual(found["status"], "failure")
        self.assertIn("the schema hash is '0123456789abcdef', not '", found["detail"])
        self.assertIn("its size is 56 bytes, not 576", found["detail"])
        self.assertIn("iceoryx2 0.10", found["detail"])

    def test_without_a_publisher_it_says_what_to_do(self):
        document = self.check("nobody", "--source", "external")
        self.assertFalse(document["ok"])
        (frames,) = [f for f in document["findings"] if f["check"] == "frames"]
        self.assertIn("vigil/nobody/sensor", frames["detail"])


if __name__ == "__main__":
    unittest.main()
