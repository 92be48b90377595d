"""A recording of the black box is decoded and drawn by a viewer, Rerun, without a display."""

import contextlib
import io
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import unittest

from recordings import recordings  # It says where the harness lies.

import numpy
from harness import EXAMPLES, ROOT, WATCHDOG_S, wait_for
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image
from rerun.experimental import ViewerClient
from rerun_layout import COLOURS

RERUN = pathlib.Path(sys.executable).with_name("rerun")
# The picture, for people to look at.
PICTURE = ROOT / "target" / "rerun.png"
SIZE = 1600, 1200
PLOTS = ["wheels, rad/s", "belief", "decision"]
WHEELS = ["LF", "LM", "LR", "RF", "RM", "RR"]
# The legend lies left of this column of a plot, what is looked at right of it.
LEGEND = 160


def has_vulkan():
    """What the viewer draws by without a display; Mesa has a driver that needs no graphics card."""
    folders = pathlib.Path("/usr/share/vulkan/icd.d"), pathlib.Path("/etc/vulkan/icd.d")
    return any(list(folder.glob("*.json")) for folder in folders)


class Plot:
    """The picture of a plot."""

    def __init__(self, png):
        self.pixels = numpy.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)

    def places(self, place):
        """Rows and columns of the pixels that have the colour of the curve at this place."""
        return numpy.nonzero(numpy.abs(self.pixels - COLOURS[place]).max(axis=2) <= 12)

    def curve(self, place):
        rows, columns = self.places(place)
        kept = columns > LEGEND
        return rows[kept], columns[kept]

    def at_the_top(self, place):
        """Columns in which a curve lies near the top."""
        rows, columns = self.curve(place)
        return columns[rows < self.pixels.shape[0] / 8]

    def legend(self, names):
        """Those of the names that have their colour in the legend."""
        at = [(self.places(place)[1] <= LEGEND).sum() for place in range(len(names))]
        return [name for name, count in zip(names, at) if count > 20]


class Rerun(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.home = folder.name
        cls.recording = recordings().alarm
        # It would send statistics of its use.
        cls.rerun("analytics", "disable")

    @classmethod
    def environment(cls):
        """The viewer's settings lie in a folder of the test's own."""
        own = {"HOME": cls.home, "XDG_CONFIG_HOME": cls.home, "XDG_RUNTIME_DIR": cls.home}
        return {**os.environ, **own, "NO_COLOR": "1"}

    @classmethod
    def run_program(cls, *command):
        """What it says."""
        how = {"capture_output": True, "text": True, "timeout": WATCHDOG_S}
        ran = subprocess.run(command, env=cls.environment(), **how)
        assert ran.returncode == 0, ran.stderr
        return ran.stdout + ran.stderr

    @classmethod
    def rerun(cls, *arguments):
        return cls.run_program(RERUN, *arguments)

    @contextlib.contextmanager
    def viewer(self):
        """A viewer without a window, for this machine alone: its address, and who drives it."""
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        command = [RERUN, "--headless", "--hide-welcome-screen", "--bind", "127.0.0.1"]
        command += ["--port", str(port), "--window-size", "x".join(map(str, SIZE))]
        how = {"env": self.environment(), "start_new_session": True}
        said = pathlib.Path(self.home) / "viewer.log"
        with open(said, "w") as log:
            process = subprocess.Popen(command, stdout=log, stderr=log, **how)

        def is_up():
            self.assertIsNone(process.poll(), "the viewer ended")
            return "Headless viewer running" in said.read_text()

        try:
            wait_for(is_up, "a viewer")
            url = f"rerun+http://127.0.0.1:{port}/proxy"
            yield url, ViewerClient.connect(url)
            self.assertIsNone(process.poll(), "the viewer ended")
        except Exception as error:
            error.add_note(said.read_text())
            raise
        finally:
            # The program starts another one, in the same group.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)
            process.wait(timeout=WATCHDOG_S)

    def names(self, topic):
        """The names that the recording has for the numbers of a topic, and when it ends."""
        with open(self.recording, "rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            end_ns = reader.get_summary().statistics.message_end_time
            message = next(iter(reader.iter_decoded_messages(topics=[topic]))).decoded_message
        return list(message.name), end_ns

    def test_every_recording_is_decoded(self):
        for recording in recordings():
            with self.subTest(recording.name):
                self.assert_decoded(recording)

    def assert_decoded(self, recording):
        converted = pathlib.Path(self.home) / "flight.rrd"
        self.rerun("mcap", "convert", recording, "--output", converted)
        self.rerun("rrd", "verify", converted)
        said = self.rerun("rrd", "print", "-v", converted)
        # Decoded, not only kept as bytes: numbers as curves, messages by their fields.
        found = set(re.findall(r"(/[\w/]+)@([\w:.]+)", said))
        for path in ("/vigil/belief/position", "/joint_states/velocity"):
            self.assertIn((path, "Scalars:scalars"), found)
            self.assertIn((path, "SeriesLines:names"), found)
        for path in ("/diagnostics", "/vigil/faults", "/odom", "/tf"):
            fields = {of for at, of in found if at == path and not of.startswith("Mcap")}
            self.assertTrue(fields, path)

    @unittest.skipUnless(has_vulkan(), "no driver for Vulkan is installed")
    def test_wheels_and_named_beliefs_are_seen(self):
        with self.viewer() as (url, driven):
            self.run_program(sys.executable, EXAMPLES / "rerun_layout.py", self.recording, url)
            beliefs, end_ns = self.names("/vigil/belief")

            def is_all_there():
                lines = [line for one in driven.get_state().recordings for line in one.timelines]
                return any(line.end == end_ns for line in lines)

            wait_for(is_all_there, "the whole recording in the viewer")
            views = {view.name: view for view in driven.get_state().views}
            self.assertEqual(set(views), {*PLOTS, "events"})
            self.assertEqual([view.reports for view in views.values() if view.reports], [])
            PICTURE.write_bytes(driven.take_screenshot())
            pictures = (driven.take_screenshot(views[name].view_id) for name in PLOTS[:2])
            wheels, belief = map(Plot, pictures)
        with Image.open(PICTURE) as picture:
            self.assertEqual(picture.size, SIZE)

        # Every wheel has a curve, and the one that sticks is alone at the bottom.
        joints, _ = self.names("/joint_states")
        curves = {name: wheels.curve(joints.index(name))[0] for name in WHEELS}
        self.assertGreater(min(map(len, curves.values())), 100)
        self.assertEqual(wheels.legend(joints)[: len(WHEELS)], WHEELS)
        lowest = {name: numpy.percentile(rows, 95) for name, rows in curves.items()}
        stuck = lowest.pop("RM")
        self.assertGreater(stuck, 1.3 * max(lowest.values()), lowest)

        # At the top is first that nothing is wrong, then the fault by its name.
        self.assertIn("RM_STUCK", belief.legend(beliefs))
        self.assertGreater(len(belief.legend(beliefs)), 10)
        top = {name: belief.at_the_top(place) for place, name in enumerate(beliefs)}
        nothing, fault = top.pop("ND"), top.pop("RM_STUCK")
        self.assertGreater(min(len(nothing), len(fault)), 100)
        self.assertLess(numpy.percentile(nothing, 95), numpy.percentile(fault, 5))
        self.assertLess(max(map(len, top.values())), len(fault) / 2)


if __name__ == "__main__":
    unittest.main()
