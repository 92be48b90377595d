"""Messages of the real definitions of ROS 2, by an independent library, and what a rover would publish."""

import csv
import functools
import gzip
import math
import sys

import numpy
from rosbags.typesys import Stores, get_typestore
from rosbags.interfaces import Nodetype

from harness import FRAMES, ROOT, STUCK_RUN

sys.path.insert(0, str(ROOT / "examples" / "ros2" / "vigil_bridge"))

STORE = get_typestore(Stores.ROS2_JAZZY)
WHEELS = ["LF", "LM", "LR", "RF", "RM", "RR"]
STEERED = ["LF", "LR", "RF", "RR"]


def message(kind, **fields):
    """A message of `sensor_msgs/Imu` with its defaults; fields as `twist__linear__x=0.5`."""
    made = _default((Nodetype.NAME, kind.replace("/", "/msg/") if "/msg/" not in kind else kind))
    for path, value in fields.items():
        *parents, name = path.split("__")
        at = made
        for parent in parents:
            at = getattr(at, parent)
        assert hasattr(at, name), (kind, path)
        setattr(at, name, value)
    return made


def _default(field):
    kind, of = field
    if kind == Nodetype.NAME:
        names_and_values = {name: _default(inner) for name, inner in STORE.get_msgdef(of).fields}
        return STORE.types[of](**names_and_values)
    if kind == Nodetype.BASE:
        return {"string": "", "bool": False}.get(of[0], 0.0 if of[0].startswith("float") else 0)
    inner, size = of
    if inner[0] == Nodetype.BASE and inner[1][0] not in ("string", "bool"):
        dtype = {"octet": "uint8", "byte": "uint8", "char": "uint8"}.get(inner[1][0], inner[1][0])
        return numpy.zeros(size if kind == Nodetype.ARRAY else 0, dtype=dtype)
    return [_default(inner) for _ in range(size if kind == Nodetype.ARRAY else 0)]


def quaternion(roll=0.0, pitch=0.0, yaw=0.0):
    """The rotation of REP 103: about x, then y, then z of the fixed frame."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return message(
        "geometry_msgs/Quaternion",
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def stamped(kind, t_s, **fields):
    """The same with a header."""
    whole_s = int(t_s)
    stamp = {"header__stamp__sec": whole_s, "header__stamp__nanosec": round(t_s % 1 * 1e9)}
    return message(kind, **stamp, **fields)


@functools.cache
def rows():
    with gzip.open(FRAMES, "rt") as file:
        return [row for row in csv.DictReader(file) if row["run"] == str(STUCK_RUN)]


def driven(row):
    """What a rover would publish at a row: topic and message."""
    value = {name: float(text) for name, text in row.items()}
    t_s, speed = 1000.0 + value["t"], value["cmd_speed"]
    odometry = stamped("nav_msgs/Odometry", t_s, pose__pose__orientation=quaternion(yaw=value["yaw"]))
    odometry.pose.pose.position.x, odometry.pose.pose.position.y = value["x"], value["y"]
    joints = stamped("sensor_msgs/JointState", t_s)
    joints.name = [f"{w}_wheel" for w in WHEELS] + [f"{w}_steer" for w in STEERED]
    joints.velocity = numpy.array([value[f"enc_{w}"] for w in WHEELS] + 4 * [0.0])
    joints.position = numpy.array(6 * [0.0] + [value[f"steer_{w}"] for w in STEERED])
    command = stamped("geometry_msgs/TwistStamped", t_s, twist__linear__x=speed)
    command.twist.angular.z = speed * value["cmd_curv"]
    return [("/odom", odometry), ("/joint_states", joints), ("/cmd_vel", command)]
