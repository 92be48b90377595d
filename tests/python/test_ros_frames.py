"""Messages of ROS 2 become frames: every usual type, by the names that its fields have."""

import math
import pathlib
import unittest

import numpy

from harness import EXAMPLES
from ros_messages import driven, message, quaternion, rows, stamped

import vigil_types as vigil
from vigil_bridge.fields import resolve
from vigil_bridge.frames import Frames, check_names
from vigil_bridge.misfit import Misfit
from vigil_bridge.settings import Settings
from vigil_bridge.sources import Source

CONFIG = EXAMPLES / "ros2" / "vigil_bridge" / "config"
ROVER = vigil.Channels.read(EXAMPLES / "rover.channels")


def parameters(name):
    """Parameters of a file of the package, as a node gets them."""
    from ruamel.yaml import YAML

    values = YAML(typ="safe").load((CONFIG / name).read_text())["/**"]["ros__parameters"]
    channels = values.pop("channels")
    return {**values, **{f"channels.{name}": source for name, source in channels.items()}}


class Fields(unittest.TestCase):
    def value(self, path, of):
        return resolve(of, path).value(of)

    def test_every_usual_type_is_read_by_its_fields(self):
        turn = quaternion(roll=0.1, pitch=-0.2, yaw=2.5)
        twist = message("geometry_msgs/Twist", linear__x=0.5, angular__z=-0.2)
        imu = message("sensor_msgs/Imu", orientation=turn, angular_velocity__z=0.3, linear_acceleration__x=9.5)
        odometry = message("nav_msgs/Odometry", pose__pose__orientation=turn, twist__twist=twist)
        odometry.pose.pose.position.x = 3.0
        joints = message("sensor_msgs/JointState", name=["a.b", "c"], velocity=numpy.array([1.0, 2.0]))
        joints.position, joints.effort = numpy.array([3.0, 4.0]), numpy.array([5.0, 6.0])
        battery = message("sensor_msgs/BatteryState", voltage=12.5, current=-1.5)
        for of, path, wanted in [
            (twist, "linear.x", 0.5),
            (twist, "curvature", -0.4),
            (message("geometry_msgs/TwistStamped", twist=twist), "angular.z", -0.2),
            (message("geometry_msgs/TwistStamped", twist=twist), "curvature", -0.4),
            (imu, "angular_velocity.z", 0.3),
            (imu, "linear_acceleration.x", 9.5),
            (imu, "orientation.roll", 0.1),
            (imu, "pitch", -0.2),
            (imu, "yaw", 2.5),
            (odometry, "pose.pose.position.x", 3.0),
            (odometry, "pose.x", 3.0),
            (odometry, "pose.yaw", 2.5),
            (odometry, "twist.twist.linear.x", 0.5),
            (odometry, "linear.x", 0.5),
            (odometry, "curvature", -0.4),
            (joints, "velocity[c]", 2.0),
            (joints, "position[a.b]", 3.0),
            (joints, "effort[1]", 6.0),
            (battery, "voltage", 12.5),
            (battery, "current", -1.5),
            (message("std_msgs/Float64MultiArray", data=numpy.array([1.0, 7.0])), "data[1]", 7.0),
            (message("std_msgs/Bool", data=True), "data", 1.0),
            (message("diagnostic_msgs/KeyValue", value=" 12.6"), "value", 12.6),
            (stamped("sensor_msgs/Imu", 2.5), "stamp", 2.5e9),
        ]:
            with self.subTest(f"{type(of).__name__} {path}"):
                self.assertAlmostEqual(self.value(path, of), wanted)

    def test_elements_of_lists_of_messages_are_found_by_their_strings(self):
        parts = [message("geometry_msgs/TransformStamped", child_frame_id=name) for name in ("mast", "base_link")]
        parts[1].transform.translation.x = 4.0
        tree = message("tf2_msgs/TFMessage", transforms=parts)
        self.assertEqual(self.value("transforms[base_link].transform.x", tree), 4.0)
        self.assertEqual(self.value("transforms[0].transform.rotation.w", tree), 0.0)
        self.assertIsNone(self.value("transforms[arm].transform.x", tree))
        with self.assertRaisesRegex(Misfit, "there is no 'colour'; there is header.stamp.sec"):
            self.value("transforms[mast].colour", tree)

    def test_what_a_message_does_not_have_is_no_value(self):
        joints = message("sensor_msgs/JointState", name=["a"])
        for path in ("velocity[a]", "velocity[b]", "velocity[3]", "position[0]"):
            self.assertIsNone(self.value(path, joints), path)
        self.assertIsNone(self.value("value", message("diagnostic_msgs/KeyValue", value="full")))

    def test_a_turn_in_place_has_no_curvature(self):
        self.assertEqual(self.value("curvature", message("geometry_msgs/Twist", angular__z=1.0)), 0.0)

    def test_paths_that_lead_nowhere_or_two_ways_say_what_there_is(self):
        odometry = message("nav_msgs/Odometry")
        for of, path, told in [
            (odometry, "linear", "there is no 'linear'; there is .*twist.twist.linear.x"),
            (odometry, "a..b", "'a..b' is no path, such as a.b"),
            (odometry, "pose[0][1]", "two elements"),
            (message("sensor_msgs/JointState"), "velocity", r"there is no 'velocity'; there is .*velocity\[...\]"),
            (message("std_msgs/Float64"), "data[0]", "there is no"),
            (message("geometry_msgs/Wrench"), "x", "'x' may be force.x or torque.x: write one"),
            (message("geometry_msgs/Twist"), "x", "'x' may be linear.x or angular.x: write one"),
        ]:
            with self.subTest(path), self.assertRaisesRegex(Misfit, told):
                resolve(of, path)


class Sources(unittest.TestCase):
    def test_a_source_is_a_topic_and_a_sum_of_paths(self):
        joints = message("sensor_msgs/JointState", name=["f 1", "r-1"], velocity=numpy.array([2.0, 4.0]))
        for text, wanted in [
            ("joint_states velocity[f 1]", 2.0),
            ("/joint_states  velocity[f 1] ", 2.0),
            ("joint_states 0.5*velocity[f 1] + 0.5 * velocity[r-1]", 3.0),
            ("joint_states -velocity[f 1] - 1e-1*velocity[r-1] + 3", 0.6),
        ]:
            source = Source("x", text)
            self.assertEqual(source.topic.strip("/"), "joint_states")
            self.assertAlmostEqual(source.value(joints), wanted, msg=text)
        joints.velocity[0] = math.inf
        self.assertTrue(math.isnan(Source("x", "joint_states velocity[f 1]").value(joints)))
        self.assertIsNone(Source("x", "joint_states velocity[f 1] + velocity[none]").value(joints))

    def test_another_text_says_how_it_is_written(self):
        for text in ["", "odom", "odom 3", "odom a b", "odom a +", "odom 2*", "odom a * 2"]:
            with self.subTest(text), self.assertRaisesRegex(Misfit, "'x' is '.*': write a topic and a path"):
                Source("x", text)
        with self.assertRaisesRegex(Misfit, "no path"):
            Source("x", "odom a..b")


class Parameters(unittest.TestCase):
    GOOD = {"channels.x": "odom pose.x"}

    def test_the_files_of_the_package_fit_the_robots_that_they_name(self):
        rover = Settings(parameters("rover.yaml"))
        check_names(ROVER, rover.sources)
        self.assertEqual((rover.graph, rover.trigger, rover.obey), ("rover", "odom", True))
        self.assertEqual(rover.topics(), ["odom", "joint_states", "cmd_vel"])
        base = Settings(parameters("differential.yaml"))
        names = ["cmd_speed", "cmd_yaw_rate"]
        text = "robot 1 kobuki\n" + "".join(f"command {i} {name} -\n" for i, name in enumerate(names))
        text += "".join(f"channel {i} {name} -\n" for i, name in enumerate(["enc_L", "enc_R", "yaw_rate"]))
        check_names(vigil.Channels(text), base.sources)

    def test_the_descriptions_of_both_robots_have_these_channels(self):
        from harness import vigil as program

        for file, robot in [("rover.yaml", "rover"), ("differential.yaml", "kobuki")]:
            done = program("channels", "--robot", f"config/robots/{robot}.toml")
            check_names(vigil.Channels(done.stdout), Settings(parameters(file)).sources)

    def test_what_does_not_fit_is_told(self):
        for given, told in [
            ({}, "no parameter below 'channels'"),
            ({**self.GOOD, "rates": 3}, "no parameter rates; there are graph, .*channels"),
            ({**self.GOOD, "rate_hz": "fast"}, "'rate_hz' is 'fast': it is to be like 20.0"),
            ({**self.GOOD, "rate_hz": True}, "'rate_hz' is True"),
            ({**self.GOOD, "rate_hz": 0}, "'rate_hz' is 0.0: it is to be above 0"),
            ({**self.GOOD, "max_age_s": math.nan}, "'max_age_s' is nan"),
            ({**self.GOOD, "command_timeout_s": -1.0}, "0 or more"),
            ({**self.GOOD, "obey": "yes"}, "'obey' is 'yes': it is to be like True"),
            ({**self.GOOD, "graph": 7}, "'graph' is 7"),
            ({**self.GOOD, "graph": "192.0.2.7:7401"}, "an address: 'channel_list' is to be the file"),
            ({**self.GOOD, "types": ["cmd_vel Twist"]}, "write a topic and a type"),
            ({"channels.x": 3.0}, "'channels.x' is 3.0"),
        ]:
            with self.subTest(told), self.assertRaisesRegex(Misfit, told):
                Settings(given)

    def test_what_fits_is_taken(self):
        given = {**self.GOOD, "rate_hz": 50, "use_sim_time": True, "qos_overrides./clock.depth": 1}
        settings = Settings({**given, "trigger": "", "types": ["cmd_vel geometry_msgs/msg/Twist"]})
        self.assertEqual((settings.rate_hz, settings.topics()), (50.0, ["odom"]))
        self.assertEqual(settings.types, {"cmd_vel": "geometry_msgs/msg/Twist"})

    def test_a_channel_that_the_robot_does_not_have_is_told_with_those_it_has(self):
        with self.assertRaisesRegex(Misfit, "no channel enc_XX; it has cmd_curv, cmd_speed, x, y, yaw"):
            check_names(ROVER, ["x", "enc_XX"])


class MakingFrames(unittest.TestCase):
    def frames(self, **options):
        settings = Settings(parameters("rover.yaml"))
        return Frames(settings.sources, **{"max_age_s": 0.5, **options})

    def take(self, frames, row, now_s=10.0):
        for topic, made in driven(row):
            frames.take(topic.strip("/"), made, now_s)

    def test_a_recorded_drive_is_mapped(self):
        row, frames = rows()[200], self.frames()
        self.take(frames, row)
        frame = frames.frame(ROVER, 77, 10.0)
        self.assertEqual((frame.header.t_capture_ns, frame.robot_hash), (77, ROVER.robot_hash))
        # Pose, six rates, four angles; no gyro, no currents.
        self.assertEqual((frame.command_valid, frame.channel_valid), (0b11, 0b1111111111111))
        for name, place in [*ROVER.axes.items(), *ROVER.channels.items()]:
            if name in frames.sources:
                value = frame.command[place] if name in ROVER.axes else frame.channel[place]
                self.assertAlmostEqual(value, float(row[name]), places=9, msg=name)

    def test_nothing_is_measured_before_a_message_comes(self):
        frame = self.frames().frame(ROVER, 1, 0.0)
        self.assertEqual((frame.command_valid, frame.channel_valid), (0, 0))
        self.assertEqual(list(self.frames().missing(ROVER, 0.0)), list(self.frames().sources))

    def test_what_is_too_old_is_not_measured(self):
        frames = self.frames()
        self.take(frames, rows()[200])
        topic, odometry = driven(rows()[201])[0]
        frames.take("odom", odometry, 10.6)
        frame = frames.frame(ROVER, 1, 10.6)
        self.assertEqual((frame.command_valid, frame.channel_valid), (0, 0b111))
        self.assertEqual(list(frame.channel)[3:], 45 * [0.0])
        self.assertIn("enc_LF", frames.missing(ROVER, 10.6))
        self.assertEqual(frames.frame(ROVER, 1, 10.5).command_valid, 0b11)

    def test_a_base_that_stops_by_itself_has_a_command_of_0_after_that(self):
        frames = self.frames(command_timeout_s=1.0)
        # None has come: it stands.
        frame = frames.frame(ROVER, 1, 0.0)
        self.assertEqual((frame.command_valid, list(frame.command)), (0b11, 8 * [0.0]))
        self.take(frames, rows()[200])
        self.assertNotEqual(frames.frame(ROVER, 1, 10.9).command[1], 0.0)
        self.assertEqual(list(frames.frame(ROVER, 1, 11.1).command), 8 * [0.0])

    def test_joints_of_several_nodes_stay_until_they_are_old_and_nan_is_none(self):
        frames = self.frames()
        self.take(frames, rows()[200])
        arm = message("sensor_msgs/JointState", name=["arm"], velocity=numpy.array([1.0]))
        frames.take("joint_states", arm, 10.1)
        self.assertEqual(frames.frame(ROVER, 1, 10.1).channel_valid, 0b1111111111111)
        broken = message("sensor_msgs/JointState", name=["LF_wheel"], velocity=numpy.array([math.nan]))
        frames.take("joint_states", broken, 10.2)
        self.assertEqual(frames.frame(ROVER, 1, 10.2).channel_valid, 0b1111111110111)

    def test_joints_without_rates_have_none(self):
        frames, joints = self.frames(), driven(rows()[200])[1][1]
        joints.velocity, joints.position[9] = joints.velocity[:0], math.nan
        frames.take("joint_states", joints, 10.0)
        self.assertEqual(frames.frame(ROVER, 1, 10.0).channel_valid, 0b111 << 9)

    def test_a_clock_that_is_set_back_begins_another_run(self):
        frames = self.frames()
        times_s = (5.0, 6.0, 5.5, 1.0, 2.0)
        runs = [frames.frame(ROVER, round(t_s * 1e9), 0.0).run_id for t_s in times_s]
        self.assertEqual(runs, [1, 1, 1, 2, 2])


if __name__ == "__main__":
    unittest.main()
