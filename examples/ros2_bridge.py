"""A ROS 2 node that sends frames from /odom, /joint_states and /cmd_vel to a graph.

Each message of /odom makes a frame. Start the graph by `scripts/up --source socket --rate HZ`, with the rate of /odom.
python3 ros2_bridge.py [GRAPH]          (needs rclpy; the mapping is in ros2_mapping.py)
GRAPH: the graph's name; or host:port of its UDP socket, or the path of its Unix socket.
"""

import sys

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

import ros2_mapping
from sending import SocketPublisher

publisher = SocketPublisher(sys.argv[1] if len(sys.argv) > 1 else "rover")
newest = {Odometry: None, JointState: None, TwistStamped: None}


def take(kind, message):
    newest[kind] = message
    if kind is not Odometry: return
    publisher.publish(ros2_mapping.frame(newest[Odometry], newest[JointState], newest[TwistStamped]))


rclpy.init()
node = rclpy.create_node("vigil_bridge")
for kind, topic in [(Odometry, "/odom"), (JointState, "/joint_states"), (TwistStamped, "/cmd_vel")]:
    node.create_subscription(kind, topic, lambda message, kind=kind: take(kind, message), qos_profile_sensor_data)
rclpy.spin(node)
