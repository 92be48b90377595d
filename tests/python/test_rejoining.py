"""Publishers of examples/ outlive their graph: they say what they wait for, and are heard by the next one."""

import os
import pathlib
import subprocess
import sys
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

    def __init__(self, *command):
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
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


def python(module, publisher, graph):
    names = {"examples": str(EXAMPLES), "frames": str(FRAMES)}
    return Speaker(sys.executable, "-c", FOR_EVER.format(module=module, publisher=publisher, **names), graph)


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
        # At a rate at which it publishes as long as this test may take.
        speaker = Speaker(BINARIES / "publisher", FRAMES, "0", name, "2")
        self.hears_each_start(speaker, name, "--source", "external")

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
