"""The node of the ROS 2 package, run against a stand-in for rclpy and a graph that the test plays over UDP."""

import contextlib
import ctypes
import fcntl
import json
import os
import pathlib
import socket
import tempfile
import time
import unittest
from unittest import mock

from harness import EXAMPLES, WATCHDOG_S, datagram_of
from ros_messages import driven, message, rows, stamped
from ros_stand_in import Ros, install
from test_ros_frames import parameters
from test_ros_verdicts import verdict

import vigil_types as vigil

CONTEXT = install()
import rclpy
from vigil_bridge import node, report
from vigil_bridge.misfit import Misfit

CHANNELS = EXAMPLES / "rover.channels"
ODOM, JOINTS = ("/odom", ["nav_msgs/msg/Odometry"]), ("/joint_states", ["sensor_msgs/msg/JointState"])
TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
OUT = {"cmd_vel_out": "/cmd_vel"}


class PlayedGraph:
    """A graph's UDP socket: takes frames, and answers with what the test says."""

    def __enter__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(WATCHDOG_S)
        self.address = f"127.0.0.1:{self.socket.getsockname()[1]}"
        self.sender = None
        return self

    def __exit__(self, *_):
        self.socket.close()

    def frame(self):
        """The next frame that comes."""
        data, self.sender = self.socket.recvfrom(4096)
        frame = vigil.SensorFrame.from_buffer_copy(data[16:])
        assert data == vigil.datagram(frame)
        return frame

    def answer(self, one):
        self.socket.sendto(datagram_of(one), self.sender)

    def is_silent(self):
        self.socket.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            self.socket.recv(4096)
            return False
        self.socket.settimeout(WATCHDOG_S)
        return True


def close(link):
    """Closes its socket, which a program has until its end."""
    if link._publisher is not None and link._publisher._sender is not None:
        link._publisher._sender.close()


class NodeTest(unittest.TestCase):
    def start(self, graph="127.0.0.1:9", topics=None, remapped=OUT, **changed):
        """The node, with the rover's parameters as `changed`."""
        topics = dict([ODOM, JOINTS, ("/cmd_vel", [STAMPED]), ("/cmd_vel_in", [STAMPED])]) if topics is None else topics
        own = {"graph": graph, "channel_list": str(CHANNELS), **changed}
        self.ros = Ros.here = Ros({**parameters("rover.yaml"), **own}, topics, remapped)
        ros_node = rclpy.create_node("vigil_bridge", automatically_declare_parameters_from_overrides=True)
        self.bridge = node.Bridge(ros_node, clock=lambda: self.ros.now_s)
        self.addCleanup(close, self.bridge.link)
        return self.ros

    def drive(self, row=200):
        """What a rover publishes at a row; the odometry last."""
        for topic, made in reversed(driven(rows()[row])):
            self.ros.send(topic, made)

    def statuses(self):
        return [array.status[0] for array in self.ros.of("/diagnostics")]

    def command(self, speed=0.2, yaw_rate=0.1):
        made = stamped("geometry_msgs/TwistStamped", 7.0, twist__linear__x=speed, twist__angular__z=yaw_rate)
        self.ros.send("/cmd_vel_in", made)
        return self.moves()[-1]

    def moves(self):
        twists = [getattr(made, "twist", made) for made in self.ros.of("/cmd_vel")]
        return [(round(twist.linear.x, 6), round(twist.angular.z, 6)) for twist in twists]


class FramesOut(NodeTest):
    def test_each_message_on_the_trigger_makes_a_frame(self):
        with PlayedGraph() as graph:
            self.start(graph.address)
            self.drive()
            frame, row = graph.frame(), rows()[200]
            self.assertEqual(frame.header.t_capture_ns, round((1000.0 + float(row["t"])) * 1e9))
            self.assertEqual((frame.command_valid, frame.channel_valid), (0b11, 0b1111111111111))
            self.assertAlmostEqual(frame.channel[3], float(row["enc_LF"]))
            self.assertAlmostEqual(frame.command[0], float(row["cmd_curv"]))
            self.ros.send("/joint_states", driven(row)[1][1])
            self.assertTrue(graph.is_silent())
            self.drive(201)
            self.assertEqual(graph.frame().header.seq, 1)

    def test_values_grow_old(self):
        with PlayedGraph() as graph:
            self.start(graph.address, command_timeout_s=0.0)
            self.drive()
            graph.frame()
            self.ros.pass_time(0.6)
            self.ros.send(*driven(rows()[201])[0])
            frame = graph.frame()
            self.assertEqual((frame.command_valid, frame.channel_valid), (0, 0b111))

    def test_without_a_trigger_a_timer_makes_them(self):
        with PlayedGraph() as graph:
            ros = self.start(graph.address, trigger="", rate_hz=10)
            self.drive()
            self.assertTrue(graph.is_silent())
            ros.pass_time(0.2)
            times = [graph.frame().header.t_capture_ns for _ in range(2)]
            self.assertEqual(times, [1000_100_000_000, 1000_200_000_000])
            self.assertTrue(graph.is_silent())

    def test_a_trigger_without_a_stamp_takes_the_clock(self):
        with PlayedGraph() as graph:
            ros = self.start(graph.address)
            ros.send("/odom", message("nav_msgs/Odometry"))
            self.assertEqual(graph.frame().header.t_capture_ns, 1000_000_000_000)

    def test_topics_are_awaited_and_taken_as_the_type_that_they_have(self):
        for kind in (TWIST, STAMPED):
            with self.subTest(kind), PlayedGraph() as graph:
                ros = self.start(graph.address, topics={})
                self.assertIn("waiting for topic '/cmd_vel'", ros.logged)
                self.assertEqual(ros.subscriptions, {})
                ros.topics = dict([ODOM, ("/cmd_vel", [kind])])
                ros.pass_time(0.6)
                self.assertEqual(sorted(ros.subscriptions), ["/cmd_vel", "/odom"])
                twist = message("geometry_msgs/Twist", linear__x=0.5, angular__z=0.25)
                ros.send("/cmd_vel", twist if kind == TWIST else message("geometry_msgs/TwistStamped", twist=twist))
                ros.send("/odom", stamped("nav_msgs/Odometry", 3.0))
                self.assertEqual(list(graph.frame().command)[:2], [0.5, 0.5])

    def test_a_type_that_is_given_is_not_looked_up(self):
        ros = self.start(topics={}, types=[f"cmd_vel {TWIST}"])
        self.assertEqual(list(ros.subscriptions), ["/cmd_vel"])

    def test_two_ways_to_write_one_topic_are_one(self):
        with PlayedGraph() as graph:
            ros = self.start(graph.address, trigger="/odom", types=[f"/cmd_vel {STAMPED}"])
            self.assertEqual(len(ros.subscriptions["/odom"]), 1)
            self.drive()
            self.assertEqual(graph.frame().channel_valid, 0b1111111111111)

    def test_topics_that_do_not_fit_are_told(self):
        for topics, changed, told in [
            ({"/odom": ["nav_msgs/msg/Odometry", "my/msg/Odometry"]}, {}, "has the types nav_msgs.*'types'"),
            ({"/odom": ["my_robot/msg/Odometry"]}, {}, "'my_robot/msg/Odometry' is not installed"),
            ({"/odom": [TWIST]}, {}, r"topic 'odom' \(Twist\): there is no 'pose.x'; there is linear.x"),
            ({"/cmd_vel_in": ["std_msgs/msg/String"]}, {}, "is of type String: it is to be Twist or TwistStamped"),
            (None, {"remapped": {"cmd_vel_in": "/cmd_vel", **OUT}}, "cmd_vel_in and cmd_vel_out are one topic"),
            (None, {"rates": 3}, "no parameter rates"),
        ]:
            with self.subTest(told), self.assertRaisesRegex(Misfit, told):
                self.start(topics=topics, **changed)

    def test_a_channel_that_the_robot_does_not_have_ends_the_node(self):
        self.start(**{"channels.enc_XX": "odom pose.x"})
        with self.assertRaisesRegex(Misfit, "no channel enc_XX; it has cmd_curv"):
            self.ros.pass_time(0.1)

    def test_a_channel_list_that_is_not_there_is_told(self):
        self.start(channel_list="/nowhere")
        with self.assertRaisesRegex(Misfit, "No such file.*/nowhere"):
            self.ros.pass_time(0.1)

    def test_main_says_what_does_not_fit_and_ends_with_1(self):
        self.ros = Ros.here = Ros({})
        self.assertEqual(node.main([]), 1)
        self.assertIn("no parameter below 'channels'", self.ros.logged[-1])
        self.assertFalse(CONTEXT.is_up)
        self.ros = Ros.here = Ros({**parameters("rover.yaml"), "graph": "127.0.0.1:9", "channel_list": str(CHANNELS)})
        CONTEXT.spun = lambda ros_node: self.ros.pass_time(0.1)
        self.assertEqual(node.main([]), 0)
        self.assertEqual(len(self.statuses()), 1)


class VerdictsBack(NodeTest):
    """After a frame has told the graph where to answer."""

    def open(self, graph, **changed):
        self.start(graph.address, **changed)
        self.drive()
        return graph.frame()

    def hear(self, graph, one):
        graph.answer(one)
        self.ros.pass_time(0.02)

    def test_diagnostics_tell_of_each_change_at_once_and_else_once_a_second(self):
        with PlayedGraph() as graph:
            self.open(graph)
            self.ros.pass_time(0.02)
            (first,) = self.statuses()
            self.assertEqual((first.level, first.message), (report.STALE, "no verdict yet; the robot is to stop"))
            self.assertEqual((first.name, first.hardware_id), (f"vigil/{graph.address}/vigil_bridge", graph.address))
            fault = dict(alarm=1, mode=4, mode_name=b"LF_STUCK", p_mode=0.99)
            self.hear(graph, verdict(valid_for_ns=10**10))
            self.hear(graph, verdict(vigil.RECOVERY_STOP, valid_for_ns=10**10, action_name=b"stop", **fault))
            self.assertEqual([status.level for status in self.statuses()], [3, 0, 2])
            self.assertEqual(self.statuses()[-1].message, "LF_STUCK p=0.99: stop")
            self.assertEqual({v.key: v.value for v in self.statuses()[-1].values}["mode"], "LF_STUCK")
            self.ros.pass_time(2.1)
            self.assertEqual(len(self.statuses()), 5)
            said = [json.loads(made.data) for made in self.ros.of("/vigil_bridge/verdict")]
            self.assertEqual([one["mode_name"] for one in said], ["ND", "LF_STUCK"])

    def test_diagnostics_name_what_is_not_measured(self):
        with PlayedGraph() as graph:
            self.open(graph)
            self.ros.pass_time(0.6)
            values = {v.key: v.value for v in self.statuses()[-1].values}
            self.assertEqual(values["not measured"], "none")
            self.ros.pass_time(1.0)
            values = {v.key: v.value for v in self.statuses()[-1].values}
            self.assertIn("enc_LF", values["not measured"])

    def test_commands_pass_as_the_verdict_has_them(self):
        for topics, out in [(STAMPED, "header"), (TWIST, "linear")]:
            kinds = dict([ODOM, JOINTS, ("/cmd_vel", [STAMPED]), ("/cmd_vel_in", [topics])])
            with self.subTest(topics), PlayedGraph() as graph:
                self.open(graph, topics=kinds)
                self.ros.subscriptions["/cmd_vel"] = []
                self.hear(graph, verdict(vigil.RECOVERY_COMPENSATE, speed_scale=0.5, curvature_offset=0.1))
                self.ros.published.clear()
                twist = message("geometry_msgs/Twist", linear__x=0.2, angular__z=0.1)
                sent = twist if topics == TWIST else message("geometry_msgs/TwistStamped", twist=twist)
                self.ros.send("/cmd_vel_in", sent)
                self.assertEqual(self.moves(), [(0.1, 0.06)])
                self.assertTrue(hasattr(self.ros.of("/cmd_vel")[0], out))

    def test_curves_are_held_at_the_sharpest(self):
        with PlayedGraph() as graph:
            self.open(graph)
            self.hear(graph, verdict(curvature_offset=9.0))
            self.assertEqual(self.command(), (0.2, 0.24))

    def test_without_a_valid_verdict_the_robot_stops(self):
        with PlayedGraph() as graph:
            self.open(graph)
            self.assertEqual(self.command(), (0.0, 0.0))
            self.hear(graph, verdict(valid_for_ns=300_000_000))
            self.assertEqual(self.command(), (0.2, 0.1))
            # The planner is silent: nothing repeats its command.
            count = len(self.moves())
            self.ros.pass_time(0.2)
            self.assertEqual(len(self.moves()), count)
            # The verdict has expired: the base is told to stand, and told again.
            self.ros.pass_time(0.3)
            self.assertEqual(set(self.moves()[count:]), {(0.0, 0.0)})
            self.assertIn(len(self.moves()) - count, (2, 3))
            self.assertEqual(self.ros.of("/cmd_vel")[-1].header.stamp.sec, 1000)
            self.assertEqual(self.command(), (0.0, 0.0))
            self.assertIn("expired", self.statuses()[-1].message)

    def test_a_verdict_that_stops_is_obeyed_before_the_next_command(self):
        with PlayedGraph() as graph:
            self.open(graph)
            self.hear(graph, verdict())
            self.command()
            self.hear(graph, verdict(vigil.RECOVERY_CALL_FOR_HELP))
            self.assertEqual(self.moves()[-1], (0.0, 0.0))
            # Again, sooner than a stop is repeated.
            self.hear(graph, verdict())
            self.assertEqual(self.command(), (0.2, 0.1))
            self.hear(graph, verdict(vigil.RECOVERY_STOP))
            self.assertEqual(self.moves()[-1], (0.0, 0.0))

    def test_frames_say_which_action_is_obeyed(self):
        with PlayedGraph() as graph:
            frame = self.open(graph)
            self.assertEqual((frame.action_seq, frame.safe_stop), (0, 0))
            self.command()
            self.drive(201)
            frame = graph.frame()
            self.assertEqual((frame.action_seq, frame.safe_stop), (0, 1))
            self.hear(graph, verdict(vigil.RECOVERY_STOP, decision_seq=9))
            self.drive(202)
            frame = graph.frame()
            self.assertEqual((frame.action_seq, frame.safe_stop, frame.action_outcome), (9, 0, 0))
            self.assertEqual(list(frame.command)[:2], [float(rows()[202][name]) for name in ("cmd_curv", "cmd_speed")])

    def test_before_the_planners_first_command_the_robot_is_left_alone(self):
        with PlayedGraph() as graph:
            self.open(graph)
            self.ros.pass_time(2.0)
            self.assertEqual(self.moves(), [])

    def test_without_obeying_only_diagnostics_are_published(self):
        with PlayedGraph() as graph:
            self.open(graph, obey=False)
            self.hear(graph, verdict())
            self.assertNotIn("/cmd_vel_in", self.ros.subscriptions)
            self.ros.pass_time(1.0)
            self.assertEqual(sorted(self.ros.published), ["/diagnostics", "/vigil_bridge/verdict"])
            self.drive(201)
            self.assertEqual(graph.frame().safe_stop, 0)

    def test_the_robot_also_stops_while_simulated_time_stands(self):
        self.start(trigger="")
        kinds = [timer["clock"] and timer["clock"].clock_type for timer in self.ros.timers]
        self.assertEqual(kinds, ["steady", "steady", None])


class GraphByName(NodeTest):
    def test_a_graph_that_starts_later_is_joined_and_the_robot_stands_meanwhile(self):
        with tempfile.TemporaryDirectory() as base, PlayedGraph() as graph:
            name = f"ros{os.getpid()}"
            with mock.patch.dict(os.environ, XDG_RUNTIME_DIR=base):
                self.start(name, channel_list="")
                self.drive()
                self.ros.pass_time(1.0)
                self.assertEqual(self.statuses()[-1].level, report.STALE)
                self.assertEqual(self.command(), (0.0, 0.0))
                folder = pathlib.Path(base) / "vigil" / name
                folder.mkdir(parents=True)
                (folder / "addresses").write_text(f"udp {graph.address}\n")
                (folder / "channels").write_text(CHANNELS.read_text())
                (folder / "processes").write_text("")
                with open(folder / "lock", "w") as lock:
                    fcntl.flock(lock, fcntl.LOCK_EX)
                    until = time.monotonic() + WATCHDOG_S
                    while self.bridge.link.channels is None:
                        self.assertLess(time.monotonic(), until)
                        time.sleep(0.02)
                    self.drive(201)
                    self.assertEqual(graph.frame().channel_valid, 0b1111111111111)
                    graph.answer(verdict())
                    self.ros.pass_time(0.02)
                    self.assertEqual(self.command(), (0.2, 0.1))
                    self.assertEqual(self.statuses()[-1].hardware_id, name)


if __name__ == "__main__":
    unittest.main()
