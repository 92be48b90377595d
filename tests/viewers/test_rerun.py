"""A recording of the black box is decoded by the reader of a viewer, Rerun, without a display."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))

from harness import WATCHDOG_S, Graph, vigil

RERUN = pathlib.Path(sys.executable).with_name("rerun")


def rerun(*arguments):
    command = [RERUN, *arguments]
    # It would send statistics of its use.
    environment = {**os.environ, "RERUN_ANALYTICS_ENABLED": "0", "NO_COLOR": "1"}
    ran = subprocess.run(command, capture_output=True, text=True, timeout=WATCHDOG_S, env=environment)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout + ran.stderr


def snapshot(graph, folder):
    """Has the black box of a graph write what it has; the recording."""
    until = time.monotonic() + WATCHDOG_S
    while time.monotonic() < until:
        vigil("snapshot", "for a viewer", "--graph", graph.name)
        listed = json.loads(vigil("recordings", "--json", "--graph", graph.name).stdout or "{}")
        if listed.get("recordings"):
            return pathlib.Path(listed["folder"]) / listed["recordings"][0]["name"]
        time.sleep(0.5)
    raise TimeoutError("no recording")


class Rerun(unittest.TestCase):
    def test_a_recording_is_decoded(self):
        with tempfile.TemporaryDirectory() as folder:
            with Graph("--duration", "60", recordings=folder) as graph:
                graph.wait_until_up()
                recording = snapshot(graph, folder)
                graph.stop()
            converted = pathlib.Path(folder) / "flight.rrd"
            rerun("mcap", "convert", recording, "--output", converted)
            rerun("rrd", "verify", converted)
            said = rerun("rrd", "print", "-v", converted)
        for entity in ("/vigil/belief", "/joint_states", "/diagnostics", "/vigil/faults", "/odom", "/tf"):
            self.assertIn(entity, said)
        # Decoded, not only kept as bytes.
        self.assertIn("JointState", said)


if __name__ == "__main__":
    unittest.main()
