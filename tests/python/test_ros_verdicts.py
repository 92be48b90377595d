"""Verdicts become diagnostics, and commands that the robot may carry out. The rules are those of Vigil's own rover."""

import json
import math
import unittest

from ros_messages import message

import vigil_types as vigil
from vigil_bridge import report
from vigil_bridge.gate import passed, stopped
from vigil_bridge.newest import DRIVING, STANDING, Newest

KINDS = {name: value for name, value in vars(vigil).items() if name.startswith("RECOVERY_")}


def verdict(kind=vigil.RECOVERY_GO_ON, **fields):
    """One that lets the robot go on as planned."""
    plain = dict(speed_scale=1.0, curvature_gain=1.0, valid_for_ns=500_000_000, decision_seq=7)
    plain |= dict(mode_name=b"ND", runner_up_name=b"LF_STUCK", action_name=b"go_on")
    return vigil.Verdict(**{**plain, "kind": kind, **fields})


class Sends:
    """A publisher to which verdicts come."""

    def __init__(self, *verdicts):
        self.verdicts = list(verdicts)

    def verdict(self):
        return self.verdicts.pop(0) if self.verdicts else None


def newest(*verdicts, now_s=0.0):
    of = Newest()
    while not of.look(Sends(*verdicts), now_s) and verdicts:
        pass
    return of


class Validity(unittest.TestCase):
    def test_a_verdict_is_valid_from_its_arrival_and_no_longer(self):
        of = newest(verdict(), now_s=3.0)
        self.assertIsNotNone(of.driving(3.5))
        self.assertIsNone(of.driving(3.5001))
        self.assertEqual((of.rejection(3.5), of.rejection(3.5001)), (None, "expired"))

    def test_it_counts_from_the_last_look_that_found_nothing(self):
        of, sends = Newest(), Sends(None, verdict())
        self.assertFalse(of.look(sends, 1.0))
        self.assertTrue(of.look(sends, 1.2))
        self.assertIsNotNone(of.driving(1.5))
        self.assertIsNone(of.driving(1.51))

    def test_another_renews_it(self):
        of, sends = Newest(), Sends(verdict(), None, verdict(decision_seq=8))
        self.assertEqual([of.look(sends, t) for t in (0.0, 0.3, 0.4, 0.5)], [True, False, True, False])
        self.assertEqual(of.driving(0.7).decision_seq, 8)

    def test_without_a_valid_action_it_says_why(self):
        for reason, of in [
            ("nothing", Newest()),
            ("nothing", newest(verdict(vigil.RECOVERY_NONE))),
            ("expired", newest(verdict(valid_for_ns=0))),
            ("unknown-kind", newest(verdict(77))),
            ("not-finite", newest(verdict(curvature_offset=math.nan))),
            ("not-finite", newest(verdict(curvature_gain=-math.inf))),
            ("not-finite", newest(verdict(vigil.RECOVERY_STOP, speed_scale=math.inf))),
            ("out-of-range", newest(verdict(speed_scale=1.01))),
            ("out-of-range", newest(verdict(speed_scale=-0.1))),
        ]:
            self.assertEqual((of.rejection(0.0), of.driving(0.0)), (reason, None))

    def test_every_kind_drives_or_stands(self):
        self.assertEqual(sorted((*DRIVING, *STANDING, vigil.RECOVERY_NONE)), sorted(KINDS.values()))
        for name, kind in KINDS.items():
            of = newest(verdict(kind))
            self.assertEqual(of.driving(0.0) is not None, kind in DRIVING, name)


class Gate(unittest.TestCase):
    PLANNED = dict(linear__x=0.2, angular__z=0.1)

    def twist(self, **fields):
        return message("geometry_msgs/Twist", **fields)

    def assert_moves(self, command, speed, yaw_rate):
        self.assertAlmostEqual(command.linear.x, speed)
        self.assertAlmostEqual(command.angular.z, yaw_rate)

    def test_driving_kinds_scale_the_speed_and_bend_the_curvature(self):
        for kind in DRIVING:
            bends = verdict(kind, speed_scale=0.5, curvature_gain=1.1, curvature_offset=-0.2)
            planned = self.twist(**self.PLANNED)
            # Curvature 0.5 becomes 0.35, at half the speed.
            self.assert_moves(passed(planned, newest(bends).driving(0.0)), 0.1, 0.035)
            self.assert_moves(planned, 0.2, 0.1)

    def test_going_on_changes_nothing(self):
        self.assert_moves(passed(self.twist(**self.PLANNED), verdict()), 0.2, 0.1)

    def test_driving_backwards_keeps_its_curvature(self):
        bends = verdict(curvature_gain=2.0, curvature_offset=0.1)
        self.assert_moves(passed(self.twist(linear__x=-0.2, angular__z=0.1), bends), -0.2, -0.2 * (2 * -0.5 + 0.1))

    def test_a_turn_in_place_is_slowed_down(self):
        slow = verdict(vigil.RECOVERY_SLOW_DOWN, speed_scale=0.5, curvature_gain=3.0, curvature_offset=1.0)
        self.assert_moves(passed(self.twist(angular__z=1.0), slow), 0.0, 0.5)

    def test_the_other_axes_are_scaled(self):
        out = passed(self.twist(linear__y=0.4, linear__z=0.2, angular__x=1.0), verdict(speed_scale=0.5))
        self.assertEqual((out.linear.y, out.linear.z, out.angular.x), (0.2, 0.1, 0.5))

    def test_a_curve_is_held_at_the_sharpest(self):
        self.assert_moves(passed(self.twist(**self.PLANNED), verdict(curvature_offset=-5.0), 1.2), 0.2, -0.24)

    def test_what_stands_stops_and_so_does_a_command_that_is_no_number(self):
        for kind in STANDING:
            self.assert_moves(passed(self.twist(**self.PLANNED), newest(verdict(kind)).driving(0.0)), 0.0, 0.0)
        for field in ("linear__x", "linear__y", "angular__z"):
            broken = {**self.PLANNED, field: math.nan}
            self.assertEqual(passed(self.twist(**broken), verdict()), self.twist())
        self.assert_moves(passed(self.twist(**self.PLANNED), verdict(curvature_gain=1e308)), 0.2, 0.2 * 0.5e308)
        self.assert_moves(passed(self.twist(linear__x=0.1, angular__z=1.0), verdict(curvature_gain=1e308)), 0.0, 0.0)

    def test_a_stamped_command_keeps_its_header(self):
        planned = message("geometry_msgs/TwistStamped", twist=self.twist(**self.PLANNED), header__frame_id="base")
        out = passed(planned, verdict(speed_scale=0.5))
        self.assertEqual((out.header.frame_id, out.twist.linear.x), ("base", 0.1))
        self.assertEqual(stopped(planned).twist, self.twist())


class Diagnostics(unittest.TestCase):
    def status(self, *verdicts, now_s=0.0):
        return report.status(newest(*verdicts), now_s, "left", ["enc_LF"])

    def test_levels_and_messages(self):
        named = dict(alarm=1, mode=4, mode_name=b"LF_STUCK", p_mode=0.97)
        unknown = dict(alarm=1, mode=1000, mode_name=b"UNKNOWN")
        slow, stop = vigil.RECOVERY_SLOW_DOWN, vigil.RECOVERY_STOP
        for level, said, one in [
            (report.OK, "^no fault$", verdict()),
            (report.OK, "^no fault, at 50% of the speed$", verdict(speed_scale=0.5)),
            (report.WARN, "no alarm: slow", verdict(slow, action_name=b"slow")),
            (report.WARN, r"fault without a name \(UNKNOWN\): go_on", verdict(**unknown)),
            (report.WARN, r"fault without a name \(ND\): slow", verdict(slow, alarm=1, action_name=b"slow")),
            (report.WARN, "lost: identifier: go_on", verdict(lost_stages=1)),
            (report.ERROR, r"without a name \(UNKNOWN\): stop", verdict(stop, action_name=b"stop", **unknown)),
            (report.ERROR, "without a name", verdict(vigil.RECOVERY_CALL_FOR_HELP, **unknown)),
            (report.ERROR, r"LF_STUCK p=0.97: bend", verdict(vigil.RECOVERY_COMPENSATE, action_name=b"bend", **named)),
            (report.ERROR, "LF_STUCK", verdict(**named)),
            (report.ERROR, "no alarm: stop", verdict(stop, action_name=b"stop")),
            (report.STALE, r"blind \(command\): go_on", verdict(blind=5, mode=1002, mode_name=b"BLIND")),
            (report.ERROR, "cannot be obeyed: unknown-kind", verdict(77)),
            (report.ERROR, "cannot be obeyed: not-finite", verdict(speed_scale=math.nan)),
            (report.STALE, "no valid verdict: nothing", verdict(vigil.RECOVERY_NONE)),
            (report.STALE, "no valid verdict: expired", verdict(valid_for_ns=0)),
        ]:
            with self.subTest(said):
                found, text, _ = self.status(one)
                self.assertEqual(found, level)
                self.assertRegex(text, said)
        self.assertEqual(self.status()[:2], (report.STALE, "no verdict yet; the robot is to stop"))
        self.assertEqual(self.status(verdict(), now_s=0.6)[0], report.STALE)

    def test_values(self):
        size = dict(size=0.62, size_sd=0.03, size_kind=vigil.SIZE_GAIN)
        one = verdict(alarm=1, mode=4, mode_name=b"LF_GAIN", p_mode=0.9, p_fault=0.99, alarm_count=2, stuck_wheels=8, **size)
        values = dict(self.status(one)[2])
        wanted = {"graph": "left", "not measured": "enc_LF", "mode": "LF_GAIN", "probability": "0.9000"}
        wanted |= {"runner-up": "LF_STUCK", "size": "gain 0.62 sd 0.03", "action": "go_on", "kind of action": "go_on"}
        wanted |= {"p_fault": "0.990", "alarm": "yes", "alarms": "2", "blind": "no", "decision": "7"}
        wanted |= {"stuck wheels": "3", "broken encoders": "none"}
        self.assertEqual({key: values[key] for key in wanted}, wanted)
        self.assertEqual(dict(self.status(verdict(size_kind=vigil.SIZE_STUCK))[2])["size"], "stuck")
        self.assertTrue(all(isinstance(value, str) for value in values.values()))

    def test_json_has_every_field_and_no_nan(self):
        said = json.loads(report.as_json(verdict(size=math.nan)))
        self.assertEqual({name for name, *_ in vigil.Verdict._fields_} - set(said), {"header"})
        self.assertEqual((said["size"], said["mode_name"], said["kind_name"]), (None, "ND", "go_on"))


if __name__ == "__main__":
    unittest.main()
