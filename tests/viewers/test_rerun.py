"""A recording of the black box is decoded by the reader of a viewer, Rerun, without a display."""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))

from harness import WATCHDOG_S, Graph, vigil

RERUN = pathlib.Path(sys.executable).with_name("rerun")


def rerun(home, *arguments):
    """What the viewer's program says; its settings lie in a folder of the test's own."""
    environment = {**os.environ, "HOME": home, "XDG_CONFIG_HOME": home, "NO_COLOR": "1"}
    command = [RERUN, *arguments]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=WATCHDOG_S, env=environment)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout + ran.stderr


def snapshot(graph):
    """Has the black box of a graph write what it has; the recording."""
    until = time.monotonic() + WATCHDOG_S
    while time.monotonic() < until:
        vigil("snapshot", "for a viewer", "--graph", graph.name)
        listed = json.loads(vigil("recordings", "--json", "--graph", graph.name).stdout or "{}")
        whole = [one["name"] for one in listed.get("recordings", []) if one["name"].endswith(".mcap")]
        if whole:
            return pathlib.Path(listed["folder"]) / whole[0]
        time.sleep(0.5)
    raise TimeoutError("no recording")


class Rerun(unittest.TestCase):
    def test_a_recording_is_decoded(self):
        with tempfile.TemporaryDirectory() as folder:
            with Graph("--duration", "60", recordings=folder) as graph:
                graph.wait_until_up()
                recording = snapshot(graph)
                graph.stop()
            converted = pathlib.Path(folder) / "flight.rrd"
            # It would send statistics of its use.
            rerun(folder, "analytics", "disable")
            rerun(folder, "mcap", "convert", recording, "--output", converted)
            rerun(folder, "rrd", "verify", converted)
            said = rerun(folder, "rrd", "print", "-v", converted)
        # Decoded, not only kept as bytes: numbers as curves, messages by their fields.
        found = set(re.findall(r"(/[\w/]+)@([\w:.]+)", said))
        for path in ("/vigil/belief/position", "/joint_states/velocity"):
            self.assertIn((path, "Scalars:scalars"), found)
        for path in ("/diagnostics", "/vigil/faults", "/odom", "/tf"):
            columns = {column for at, column in found if at == path and not column.startswith("Mcap")}
            self.assertTrue(columns, path)


if __name__ == "__main__":
    unittest.main()
