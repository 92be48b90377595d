"""Makes a frame of the newest ROS 2 messages. Change the names to those of your robot."""

import math
import pathlib

import vigil_types as vigil

# What `vigil channels --robot F` printed for your robot.
CHANNELS = vigil.Channels.read(pathlib.Path(__file__).with_name("rover.channels"))
# Channels, and the joints whose velocities and positions they are.
ROLL = {f"enc_{wheel}": f"{wheel}_wheel" for wheel in ["LF", "LM", "LR", "RF", "RM", "RR"]}
STEER = {f"steer_{wheel}": f"{wheel}_steer" for wheel in ["LF", "LR", "RF", "RR"]}


def yaw(q):
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def frame(odometry, joints, command):
    """nav_msgs/Odometry, sensor_msgs/JointState, geometry_msgs/TwistStamped; None for what has not come."""
    out = vigil.SensorFrame(run_id=1, robot_hash=CHANNELS.robot_hash)
    if odometry is not None:
        stamp, position = odometry.header.stamp, odometry.pose.pose.position
        out.header.t_capture_ns = stamp.sec * 10**9 + stamp.nanosec
        CHANNELS.set(out, "x", position.x)
        CHANNELS.set(out, "y", position.y)
        CHANNELS.set(out, "yaw", yaw(odometry.pose.pose.orientation))
    if joints is not None:
        # A joint without a velocity or a position, or with NaN, was not measured.
        rates, angles = dict(zip(joints.name, joints.velocity)), dict(zip(joints.name, joints.position))
        for wanted, values in [(ROLL, rates), (STEER, angles)]:
            for channel, joint in wanted.items():
                if math.isfinite(values.get(joint, math.nan)):
                    CHANNELS.set(out, channel, values[joint])
    if command is not None:
        # The rover's command is curvature and speed.
        speed, turn = command.twist.linear.x, command.twist.angular.z
        CHANNELS.command(out, "cmd_curv", turn / speed if abs(speed) > 1e-3 else 0.0)
        CHANNELS.command(out, "cmd_speed", speed)
    return out
