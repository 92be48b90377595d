"""Publishers of examples/ outlive their graph: they say what they wait for, and are heard by the next one."""

import gzip
import json
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import threading
import unittest

from harness import BINARIES, EXAMPLES, FRAMES, ROOT, WATCHDOG_S, Graph

# Publishes one frame again and again, for ever; the first word is the class, the second the graph.
FOR_EVER = """import sys, time
sys.path.insert(0, {examples!r})
import recording
from {module} import {publisher}
publisher = {publisher}(sys.argv[1])
frames = list(recording.frames({frames!r}, 0, publisher.channels))
while True:
    for frame in frames:
        frame.header.t_capture_ns, frame.run_id = time.monotonic_ns(), 1
        publisher.publish(frame)
        time.sleep(0.05)
"""


class Speaker:
    """A publisher as a process, and the lines that it says."""

    def __init__(self, *command, stdin=None):
        pipes = {"stdin": stdin, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        self.process = subprocess.Popen(command, cwd=ROOT, text=True, **pipes)
        self.lines, self.changed = [], threading.Condition()
        self.reader = threading.Thread(target=self._read)
        self.reader.start()

    def _read(self):
        for line in self.process.stderr:
            with self.changed:
                self.lines.append(line.strip())
                self.changed.notify_all()

    def wait_for(self, words, after=0):
        """Until it has said a line with these words after so many lines; that line."""
        said = lambda: [line for line in self.lines[after:] if words in line]
        with self.changed:
            if not self.changed.wait_for(said, timeout=WATCHDOG_S):
                raise AssertionError(f"never said: {words}; said: {self.lines}")
            return said()[0]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.reader.join()
        self.process.stderr.close()


def long_run():
    """Lines of a recording, run 0 round and round: longer than a test may take."""
    with gzip.open(FRAMES, "rt") as file:
        head, *rows = file.read().splitlines()
    rows = [row.split(",", 2)[2] for row in rows if row.startswith("0,")]
    return [head, *(f"0,{0.05 * i},{rows[i % len(rows)]}" for i in range(20 * WATCHDOG_S))]


def python(module, publisher, graph):
    names = {"examples": str(EXAMPLES), "frames": str(FRAMES)}
    return Speaker(sys.executable, "-c", FOR_EVER.format(module=module, publisher=publisher, **names), graph)


class SideBySide(unittest.TestCase):
    def test_two_graphs_on_one_file_take_datagrams_each_from_its_own_publisher(self):
        """One option each: the name."""
        names = [f"py{os.getpid()}-left", f"py{os.getpid()}-right"]
        line = [BINARIES / "vigil-launcher", "--json", "--no-blackbox", "--config", ROOT / "config" / "rover.toml"]
        line += ["--source", "socket", "--rate", "20", "--duration", "2", "--graph"]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": ROOT}
        graphs = [subprocess.Popen([*line, name], **pipes) for name in names]
        try:
            speakers = [python("sending", "SocketPublisher", name) for name in names]
            with speakers[0], speakers[1]:
                for name, graph in zip(names, graphs):
                    out, err = graph.communicate(timeout=WATCHDOG_S)
                    self.assertIn(f"graph '{name}' takes datagrams at udp 127.0.0.1:2", err)
                    summary = json.loads(out)
                    self.assertEqual(summary["ended"], "duration", err)
                    # Frames of the other's publisher would be refused: one sender is a graph's.
                    self.assertEqual(summary["services"]["sensor-sim"]["rejected"], {})
        finally:
            for graph in graphs:
                graph.kill()
                graph.communicate()

    def test_an_address_may_be_given(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            address = "127.0.0.1:%d" % free.getsockname()[1]
        options = ["--source", "socket", "--rate", "20", "--socket", address, "--duration", "1"]
        with Graph(*options) as graph, python("sending", "SocketPublisher", address):
            summary = graph.finish()
        self.assertEqual(summary["ended"], "duration")


    def test_an_address_that_is_taken_is_refused(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            address = "127.0.0.1:%d" % taken.getsockname()[1]
            with Graph("--source", "socket", "--socket", address) as graph:
                _, told = graph.launcher.communicate(timeout=WATCHDOG_S)
        self.assertEqual(graph.launcher.returncode, 2)
        self.assertRegex(told, f"udp {address}: .*; another address: --socket")


class Rejoining(unittest.TestCase):
    def hears_each_start(self, speaker, name, *options):
        """Three graphs of one name, one after the other; each ends by itself when it has had frames for a while."""
        with speaker:
            speaker.wait_for(f"waiting for graph '{name}'; running: ")
            for start in range(3):
                said = len(speaker.lines)
                with Graph(*options, "--duration", "1", name=name) as graph:
                    speaker.wait_for(f"joined graph '{name}'", said)
                    summary = graph.finish()
                self.assertEqual(summary["ended"], "duration", start)
                self.assertGreater(summary["services"]["detector"]["cycles"], 10)
                self.assertEqual(summary["services"]["detector"]["rejected"], {})
                speaker.wait_for(f"waiting for graph '{name}'", said)
            self.assertIsNone(speaker.process.poll())

    def test_python_through_shared_memory(self):
        name = f"py{os.getpid()}-again"
        self.hears_each_start(python("joining", "Publisher", name), name, "--source", "external", "--rate", "20")

    def test_python_through_a_socket(self):
        name = f"py{os.getpid()}-socket"
        self.hears_each_start(python("sending", "SocketPublisher", name), name, "--source", "socket", "--rate", "20")

    def test_rust_through_shared_memory(self):
        name = f"py{os.getpid()}-rust"
        with tempfile.TemporaryDirectory() as folder:
            recording = pathlib.Path(folder) / "long.csv.gz"
            with gzip.open(recording, "wt") as file:
                file.write("\n".join(long_run()) + "\n")
            speaker = Speaker(BINARIES / "publisher", recording, "0", name)
            self.hears_each_start(speaker, name, "--source", "external", "--rate", "20")

    def test_cpp_through_a_socket(self):
        name = f"py{os.getpid()}-cpp"
        with tempfile.TemporaryDirectory() as folder:
            program = pathlib.Path(folder) / "publisher"
            flags = ["-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror", f"-I{EXAMPLES}"]
            subprocess.run(["c++", *flags, EXAMPLES / "socket_publisher.cpp", "-o", program], check=True)
            rows = pathlib.Path(folder) / "rows"
            rows.write_text("\n".join(long_run()[1:]) + "\n")
            with open(rows) as file:
                speaker = Speaker(program, name, stdin=file)
            self.hears_each_start(speaker, name, "--source", "socket", "--rate", "20")

    def test_a_graph_that_was_killed_is_none(self):
        name = f"py{os.getpid()}-killed"
        with python("joining", "Publisher", name) as speaker:
            speaker.wait_for("waiting for graph")
            with Graph("--source", "external", "--rate", "20", name=name) as graph:
                speaker.wait_for("joined")
                folder = graph.wait_until_up()
                graph.launcher.kill()
                for line in (folder / "processes").read_text().splitlines():
                    os.kill(int(line.split()[1]), 9)
                graph.launcher.communicate()
            # Its files are there still.
            self.assertTrue((folder / "processes").exists())
            speaker.wait_for("waiting for graph", after=2)
            with Graph("--source", "external", "--rate", "20", "--duration", "1", name=name) as graph:
                self.assertEqual(graph.finish()["ended"], "duration")

    def test_a_wrong_name_is_told_with_the_right_ones(self):
        with Graph("--source", "external", "--rate", "20") as graph:
            graph.wait_until_up()
            for command in [
                [sys.executable, EXAMPLES / "publisher.py"],
                [sys.executable, EXAMPLES / "socket_publisher.py"],
                [BINARIES / "publisher"],
            ]:
                with Speaker(*command, FRAMES, "3", "no-such-graph") as speaker:
                    told = speaker.wait_for("waiting for graph 'no-such-graph'; running: ")
                    self.assertIn(graph.name, told)

    def test_another_version_of_the_transport_is_told(self):
        with Graph("--source", "external", "--rate", "20") as graph:
            types = pathlib.Path(graph.wait_until_up()) / "types"
            types.write_text(types.read_text().replace(" 0.10.0", " 0.9.0"))
            with python("joining", "Publisher", graph.name) as speaker:
                speaker.wait_for("the graph has iceoryx2 0.9.0, this program 0.10.0")
                self.assertEqual(speaker.process.wait(WATCHDOG_S), 1)


if __name__ == "__main__":
    unittest.main()
