"""ROS 2 messages made by an independent library: recordings are imported, and the bridge maps them."""

import csv
import gzip
import json
import math
import pathlib
import tempfile
import unittest

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from harness import FRAMES, ROOT, STUCK_RUN, vigil

import ros2_mapping

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = STORE.types
WHEELS = ["LF", "LM", "LR", "RF", "RM", "RR"]
STEERED = ["LF", "LR", "RF", "RR"]


def rows():
    with gzip.open(FRAMES, "rt") as file:
        return [row for row in csv.DictReader(file) if row["run"] == str(STUCK_RUN)]


def header(t_s):
    stamp = TYPE["builtin_interfaces/msg/Time"](int(t_s), round(t_s % 1 * 1e9))
    return TYPE["std_msgs/msg/Header"](stamp, "odom")


def vector(x=0.0, y=0.0, z=0.0):
    return TYPE["geometry_msgs/msg/Vector3"](x, y, z)


def twist(linear, angular):
    return TYPE["geometry_msgs/msg/Twist"](vector(x=linear), vector(z=angular))


def messages(row):
    """What a rover would publish at a row: topic, type, message."""
    import numpy

    value = {name: float(text) for name, text in row.items()}
    t_s, half = 1000.0 + value["t"], value["yaw"] / 2
    point = TYPE["geometry_msgs/msg/Point"](value["x"], value["y"], 0.0)
    turn = TYPE["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(half), math.cos(half))
    pose = TYPE["geometry_msgs/msg/Pose"](point, turn)
    nothing = numpy.zeros(36)
    odometry = TYPE["nav_msgs/msg/Odometry"](
        header(t_s),
        "base_link",
        TYPE["geometry_msgs/msg/PoseWithCovariance"](pose, nothing),
        TYPE["geometry_msgs/msg/TwistWithCovariance"](twist(0.0, 0.0), nothing),
    )
    names = [f"{w}_wheel" for w in WHEELS] + [f"{w}_steer" for w in STEERED]
    rates = [value[f"enc_{w}"] for w in WHEELS] + 4 * [0.0]
    angles = 6 * [0.0] + [value[f"steer_{w}"] for w in STEERED]
    joints = TYPE["sensor_msgs/msg/JointState"](
        header(t_s), names, numpy.array(angles), numpy.array(rates), numpy.array([])
    )
    speed = value["cmd_speed"]
    command = TYPE["geometry_msgs/msg/TwistStamped"](header(t_s), twist(speed, speed * value["cmd_curv"]))
    return [("/odom", odometry), ("/joint_states", joints), ("/cmd_vel", command)]


class Ros(unittest.TestCase):
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
                    for topic, message in messages(row):
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
            driven = rows()
            self.assertAlmostEqual(len(imported), len(driven), delta=2)
            # The same values, a frame later or earlier at most, or held over the message that was lacking.
            for column in driven[0]:
                if column in ("run", "t"):
                    continue
                ours = [float(row[column]) for row in imported]
                theirs = [float(row[column]) for row in driven]
                for i, value in enumerate(ours):
                    near = theirs[max(0, i - 2) : i + 2]
                    self.assertTrue(any(abs(value - other) < 2e-4 for other in near), (column, i, value, near))

    def test_the_bridge_maps_messages_to_a_frame(self):
        row = rows()[200]
        frame = ros2_mapping.frame(*(message for _, message in messages(row)))
        self.assertAlmostEqual(frame.channel[2], float(row["yaw"]), places=9)
        self.assertAlmostEqual(frame.command[0], float(row["cmd_curv"]), places=9)
        self.assertEqual(frame.channel[7], float(row["enc_RM"]))
        self.assertEqual(frame.channel[11], float(row["steer_RF"]))
        self.assertEqual(frame.header.t_capture_ns, round((1000.0 + float(row["t"])) * 1e9))
        # Pose, six rates, four angles; no gyro, no currents.
        self.assertEqual((frame.command_valid, frame.channel_valid), (0b11, 0b1111111111111))
        nothing = ros2_mapping.frame(None, None, None)
        self.assertEqual((nothing.command_valid, nothing.channel_valid), (0, 0))
        joints = messages(row)[1][1]
        joints.velocity, joints.position[9] = joints.velocity[:0], math.nan
        frame = ros2_mapping.frame(None, joints, None)
        self.assertEqual(frame.channel_valid, 0b111 << 9)


if __name__ == "__main__":
    unittest.main()
