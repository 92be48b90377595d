"""A ROS 2 node that sends frames from /odom, /joint_states and /cmd_vel to a graph.

Each message of /odom makes a frame. Start the graph by `scripts/up --source socket --rate HZ`, with the rate of /odom.
python3 ros2_bridge.py [ADDRESS]        (needs rclpy; the mapping is in ros2_mapping.py)
"""

import socket
import sys
import time

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

import ros2_mapping
import vigil_types as vigil

host, port = (sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1:7401").rsplit(":", 1)
sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
newest = {Odometry: None, JointState: None, TwistStamped: None}
epoch, seq = time.monotonic_ns(), 0


def take(kind, message):
    global seq
    newest[kind] = message
    if kind is not Odometry: return
    frame = ros2_mapping.frame(newest[Odometry], newest[JointState], newest[TwistStamped])
    frame.header.epoch, frame.header.seq = epoch, seq
    seq += 1
    sender.sendto(vigil.datagram(frame), (host, int(port)))


rclpy.init()
node = rclpy.create_node("vigil_bridge")
for kind, topic in [(Odometry, "/odom"), (JointState, "/joint_states"), (TwistStamped, "/cmd_vel")]:
    node.create_subscription(kind, topic, lambda message, kind=kind: take(kind, message), qos_profile_sensor_data)
rclpy.spin(node)
