"""The node of the ROS 2 package in ROS 2 itself, with another node as the robot and a graph that the test plays.

It needs rclpy: an installed ROS 2 whose setup was sourced, or these wheels, which is what it was written with:
pip install ros-kilted-rclpy==9.1.2 ros-rmw-fastrtps-cpp ros-geometry-msgs ros-nav-msgs ros-sensor-msgs \
    ros-diagnostic-msgs ros-std-msgs
"""

import os
import socket
import subprocess
import sys
import time
import unittest

from harness import EXAMPLES, WATCHDOG_S, datagram_of

import vigil_types as vigil

PACKAGE = EXAMPLES / "ros2" / "vigil_bridge"
PERIOD_S = 0.05
# More than come in a period.
CALLBACKS = 10


def has_ros():
    """True if rclpy itself is installed: another test may have put a stand-in into this process."""
    code = "import rclpy, nav_msgs.msg, diagnostic_msgs.msg"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=WATCHDOG_S).returncode == 0


class Live(unittest.TestCase):
    def test_frames_go_out_and_verdicts_come_back(self):
        if not has_ros():
            reason = "rclpy is not installed; how to get it stands at the top of this file"
            print(f"\nNOT RUN: {self.id()}: {reason}", file=sys.stderr)
            self.skipTest(reason)
        # This file again, as a program of its own.
        environment = {**os.environ, "ROS_DOMAIN_ID": "77", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        done = subprocess.run([sys.executable, __file__, "robot"], env=environment, timeout=WATCHDOG_S)
        self.assertEqual(done.returncode, 0)


class Robot:
    """A robot's other nodes, and the graph."""

    def __init__(self):
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from geometry_msgs.msg import TwistStamped
        from nav_msgs.msg import Odometry
        from sensor_msgs.msg import JointState

        rclpy.init()
        self.rclpy, self.kinds = rclpy, (Odometry, JointState, TwistStamped)
        self.node = rclpy.create_node("robot")
        self.odometry = self.node.create_publisher(Odometry, "/odom", 10)
        self.joints = self.node.create_publisher(JointState, "/joint_states", 10)
        self.planner = self.node.create_publisher(TwistStamped, "/cmd_vel_in", 10)
        self.commands, self.statuses, self.frames = [], [], []
        self.node.create_subscription(TwistStamped, "/cmd_vel", self.commands.append, 10)
        take = lambda array: self.statuses.extend(array.status)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", take, 10)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.verdict = None

    def start(self, *parameters):
        """The bridge, with the rover's parameters."""
        command = [sys.executable, "-m", "vigil_bridge.node", "--ros-args"]
        command += ["--params-file", PACKAGE / "config" / "rover.yaml", "-r", "cmd_vel_out:=cmd_vel"]
        path = os.pathsep.join([str(PACKAGE), *filter(None, [os.environ.get("PYTHONPATH")])])
        for parameter in parameters:
            command += ["-p", parameter]
        pipes = {"stderr": subprocess.PIPE, "text": True}
        self.bridge = subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path}, **pipes)

    def drive_until(self, is_done, what):
        """Publishes as a robot does, and answers as a graph does, until it is so."""
        odometry, joints, command = (kind() for kind in self.kinds)
        odometry.pose.pose.position.x, odometry.pose.pose.orientation.w = 3.5, 1.0
        joints.name, joints.velocity = ["LF_wheel", "RR_wheel"], [2.5, 2.75]
        command.twist.linear.x, command.twist.angular.z = 0.2, 0.1
        until = time.monotonic() + WATCHDOG_S / 4
        while not is_done():
            assert time.monotonic() < until and self.bridge.poll() is None, f"waited in vain for {what}"
            stamp = self.node.get_clock().now().to_msg()
            odometry.header.stamp = joints.header.stamp = command.header.stamp = stamp
            self.joints.publish(joints)
            self.planner.publish(command)
            self.odometry.publish(odometry)
            self.rclpy.spin_once(self.node, timeout_sec=PERIOD_S)
            for _ in range(CALLBACKS):
                self.rclpy.spin_once(self.node, timeout_sec=0.0)
            self.answer()
            time.sleep(PERIOD_S)

    def answer(self):
        while True:
            try:
                data, sender = self.socket.recvfrom(4096)
            except BlockingIOError:
                return
            self.frames.append(vigil.SensorFrame.from_buffer_copy(data[16:]))
            assert data == vigil.datagram(self.frames[-1])
            if self.verdict is not None:
                self.socket.sendto(datagram_of(self.verdict), sender)


def verdict(**fields):
    plain = dict(speed_scale=0.5, curvature_gain=1.0, curvature_offset=0.1, valid_for_ns=500_000_000, decision_seq=7)
    return vigil.Verdict(**{**plain, "kind": vigil.RECOVERY_SLOW_DOWN, "action_name": b"slow", **fields})


def check_both_ways(robot):
    address = f"127.0.0.1:{robot.socket.getsockname()[1]}"
    robot.start(f"graph:='{address}'", f"channel_list:='{EXAMPLES / 'rover.channels'}'")
    last = lambda: robot.commands[-1].twist if robot.commands else None
    newest = lambda: robot.statuses[-1] if robot.statuses else None
    try:
        # No verdict: the robot stands. What it stands at is what its frames say.
        robot.drive_until(lambda: last() and newest() and robot.frames and robot.frames[-1].safe_stop, "a command")
        assert (last().linear.x, last().angular.z) == (0.0, 0.0), last()
        assert newest().level == b"\x03" and newest().hardware_id == address, newest()
        frame = robot.frames[-1]
        assert (frame.channel[0], frame.channel[3], frame.channel[8]) == (3.5, 2.5, 2.75), list(frame.channel)
        assert (frame.command_valid, frame.channel_valid) == (0b11, 0b100001111), bin(frame.channel_valid)
        robot.verdict = verdict()
        robot.drive_until(lambda: last().linear.x > 0.0 and newest().level == b"\x01", "a slower command")
        assert abs(last().linear.x - 0.1) < 1e-9 and abs(last().angular.z - 0.06) < 1e-9, last()
        robot.drive_until(lambda: robot.frames[-1].action_seq == 7, "the obeyed action")
        robot.drive_until(lambda: robot.frames[-1].command[1] == 0.1, "the changed command in a frame")
        robot.verdict = verdict(kind=vigil.RECOVERY_STOP, alarm=1, mode=4, mode_name=b"LF_STUCK", p_mode=0.97)
        robot.drive_until(lambda: last().linear.x == 0.0 and newest().level == b"\x02", "a stop")
        assert newest().message == "LF_STUCK p=0.97: slow", newest()
        robot.verdict = verdict()
        robot.drive_until(lambda: last().linear.x > 0.0, "going on")
        robot.verdict = None
        robot.drive_until(lambda: last().linear.x == 0.0 and newest().level == b"\x03", "an expired verdict")
    finally:
        robot.bridge.terminate()
        errors = robot.bridge.communicate(timeout=WATCHDOG_S)[1]
        print(errors, file=sys.stderr)
    assert "Traceback" not in errors, errors


def check_error(robot):
    """A channel that the robot does not have ends the node with a sentence."""
    given = ["graph:='127.0.0.1:9'", f"channel_list:='{EXAMPLES / 'rover.channels'}'", "channels.enc_XX:='odom pose.x'"]
    robot.start(*given)
    errors = robot.bridge.communicate(timeout=WATCHDOG_S)[1]
    assert robot.bridge.returncode == 1, (robot.bridge.returncode, errors)
    assert "no channel enc_XX; it has cmd_curv" in errors and "Traceback" not in errors, errors


def main():
    robot = Robot()
    check_both_ways(robot)
    check_error(robot)
    robot.rclpy.shutdown()


if __name__ == "__main__":
    main() if sys.argv[1:] == ["robot"] else unittest.main()
