"""Makes a frame of the newest ROS 2 messages. Change the names to those of your robot."""

import math

import vigil_types as vigil

# Joints in the order of the wheels in the robot's description; None for a wheel without one.
ROLL = ["LF_wheel", "LM_wheel", "LR_wheel", "RF_wheel", "RM_wheel", "RR_wheel"]
STEER = ["LF_steer", None, "LR_steer", "RF_steer", None, "RR_steer"]


def yaw(q):
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def frame(odometry, joints, command):
    """nav_msgs/Odometry, sensor_msgs/JointState, geometry_msgs/TwistStamped; None for what has not come."""
    out = vigil.SensorFrame(run_id=1)
    if odometry is not None:
        stamp, position = odometry.header.stamp, odometry.pose.pose.position
        out.header.t_capture_ns = stamp.sec * 10**9 + stamp.nanosec
        out.pose[:] = position.x, position.y, yaw(odometry.pose.pose.orientation)
        out.valid |= vigil.VALID_POSE
    if joints is not None:
        # A joint without a velocity or a position, or with NaN, was not measured.
        rates, angles = dict(zip(joints.name, joints.velocity)), dict(zip(joints.name, joints.position))
        for i, (roll, steer) in enumerate(zip(ROLL, STEER)):
            if math.isfinite(rates.get(roll, math.nan)):
                out.wheel_rate[i] = rates[roll]
                out.valid |= vigil.VALID_WHEEL_RATE_0 << i
            if math.isfinite(angles.get(steer, math.nan)):
                out.steer[i] = angles[steer]
                out.valid |= vigil.VALID_STEER_0 << i
    if command is not None:
        # The rover's command is curvature and speed.
        speed, turn = command.twist.linear.x, command.twist.angular.z
        out.command[:2] = (turn / speed if abs(speed) > 1e-3 else 0.0), speed
        out.valid |= 3 * vigil.VALID_COMMAND_0
    return out
