"""The node of the ROS 2 package drives a real graph, which finds the fault that was recorded; rclpy is a stand-in."""

import time
import unittest

from harness import STUCK_LEAF, WATCHDOG_S, Graph, events
from ros_messages import driven, message, rows
from ros_stand_in import Ros, install
from test_ros_frames import parameters

install()
import rclpy
from vigil_bridge import node, report

HZ = 20
TOPICS = {
    "/odom": ["nav_msgs/msg/Odometry"],
    "/joint_states": ["sensor_msgs/msg/JointState"],
    "/cmd_vel": ["geometry_msgs/msg/TwistStamped"],
    "/cmd_vel_in": ["geometry_msgs/msg/Twist"],
}


class RealGraph(unittest.TestCase):
    def pass_time(self, until_s):
        while (now_s := time.monotonic()) < until_s:
            self.ros.pass_time(now_s - self.ros.now_s, step_s=now_s - self.ros.now_s)
            time.sleep(0.005)

    def drive(self):
        """The recorded drive; its planner goes straight on, through the bridge."""
        due_s = time.monotonic()
        for row in rows():
            for topic, made in reversed(driven(row)):
                self.ros.send(topic, made)
            self.ros.send("/cmd_vel_in", message("geometry_msgs/Twist", linear__x=0.2))
            due_s += 1 / HZ
            self.pass_time(due_s)

    def test_a_stuck_wheel_is_diagnosed_and_the_command_changed(self):
        # Reading them takes longer than a period.
        rows()
        with Graph("--source", "socket", "--rate", str(HZ)) as graph:
            graph.wait_for_socket()
            # What passes the bridge does not reach the recorded rover.
            remapped = {"cmd_vel_out": "/cmd_vel_obeyed"}
            self.ros = Ros.here = Ros({**parameters("rover.yaml"), "graph": graph.name}, TOPICS, remapped)
            self.ros.now_s = time.monotonic()
            ros_node = rclpy.create_node("vigil_bridge", automatically_declare_parameters_from_overrides=True)
            bridge = node.Bridge(ros_node)
            until_s = time.monotonic() + WATCHDOG_S
            while bridge.link.channels is None:
                self.assertLess(time.monotonic(), until_s)
                time.sleep(0.05)
            self.drive()
            bridge.link._publisher._sender.close()
            summary = graph.stop()
        self.assertEqual(summary["services"]["sensor-sim"]["rejected"], {})
        self.assertIn(STUCK_LEAF, events(summary, "diagnosis"))
        said = [array.status[0] for array in self.ros.of("/diagnostics")]
        self.assertIn(report.OK, [status.level for status in said])
        named = [status.message for status in said if status.level == report.ERROR and STUCK_LEAF in status.message]
        self.assertTrue(named, [status.message for status in said])
        moves = [(out.linear.x, out.angular.z) for out in self.ros.of("/cmd_vel_obeyed")]
        self.assertIn((0.2, 0.0), moves)
        # Slower, standing or counter-steering: the model decides.
        self.assertNotEqual(moves[-1], (0.2, 0.0), named)


if __name__ == "__main__":
    unittest.main()
