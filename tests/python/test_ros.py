"""Recordings of ROS 2, made by an independent library, are imported as they were driven."""

import csv
import json
import pathlib
import tempfile
import unittest

from rosbags.rosbag2 import StoragePlugin, Writer

from harness import ROOT, vigil
from ros_messages import STORE, driven, rows


class Recordings(unittest.TestCase):
    def test_a_recording_is_imported_as_it_was_driven(self):
        for storage, ending in [(StoragePlugin.MCAP, "mcap"), (StoragePlugin.SQLITE3, "db3")]:
            with self.subTest(ending):
                self.imported_as_driven(storage, ending)

    def imported_as_driven(self, storage, ending):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            with Writer(folder / "bag", version=9, storage_plugin=storage) as writer:
                open_topics = {}
                for i, row in enumerate(rows()):
                    for topic, message in driven(row):
                        kind = message.__msgtype__
                        if topic == "/joint_states" and i == 100:
                            # As from another program that knows other joints.
                            message.name[0] = "arm"
                        if topic not in open_topics:
                            open_topics[topic] = writer.add_connection(topic, kind, typestore=STORE)
                        t_ns = round((1000.0 + float(row["t"])) * 1e9)
                        writer.write(open_topics[topic], t_ns, STORE.serialize_cdr(message, kind))
            out = folder / "frames.csv"
            log = (ROOT / "config/logs/ros2-rover.toml").read_text().replace("*.mcap", f"*.{ending}")
            log = log.replace("../robots/rover.toml", str(ROOT / "config/robots/rover.toml"))
            (folder / "log.toml").write_text(log)
            arguments = ["--log", folder / "log.toml", "--from", folder / "bag", "--out", out]
            done = vigil("import", *arguments, "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(len(json.loads(done.stdout)["runs"]), 1)
            lacking = "messages on /joint_states lack a value, the first of them 'velocity[LF_wheel]'"
            self.assertIn(f"1 of {len(rows())} {lacking}", done.stderr)
            with open(out) as file:
                imported = list(csv.DictReader(file))
            wanted = rows()
            self.assertAlmostEqual(len(imported), len(wanted), delta=2)
            # The same values, a frame later or earlier at most, or held over the message that was lacking.
            for column in wanted[0]:
                if column in ("run", "t"):
                    continue
                ours = [float(row[column]) for row in imported]
                theirs = [float(row[column]) for row in wanted]
                for i, value in enumerate(ours):
                    near = theirs[max(0, i - 2) : i + 2]
                    self.assertTrue(any(abs(value - other) < 2e-4 for other in near), (column, i, value, near))


if __name__ == "__main__":
    unittest.main()
