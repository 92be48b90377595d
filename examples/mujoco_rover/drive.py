"""Drives the rover in real time as Vigil's robot: publishes its sensors and obeys Vigil's actions.

pip install iceoryx2==0.10.0 mujoco==4.0.0
scripts/up --source external              # in another window
python3 drive.py [--break stuck:RM@5] [--seconds 20] [--graph rover] [--viewer]
While it drives: type `stuck RM` or `clear RM`, and return. It ends with the graph, or with Ctrl-C.
"""

import argparse
import math
import os
import pathlib
import re
import select
import signal
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import vigil_types as vigil

try:
    import numpy
    from joining import Publisher, sensor
    from rover import NOISE, NOISE_HZ, STEERED, WHEELS, Rover, planned
except ModuleNotFoundError as error:
    raise SystemExit(f"{error}: pip install iceoryx2==0.10.0 mujoco==4.0.0")

# What Rover.state() returns, by the names of the robot's channels; a wheel that does not steer has no angle.
SENSED = ["x", "y", "yaw", *(f"enc_{w}" for w in WHEELS)]
SENSED += [f"steer_{w}" if i in STEERED else None for i, w in enumerate(WHEELS)]
KINDS = {value: name[9:].lower() for name, value in vars(vigil).items() if name.startswith("RECOVERY_")}
DRIVING = ("go_on", "slow_down", "compensate", "ignore_encoder", "limp_home", "go_through", "move_away")


def ports(topic):
    """Publisher of frames, its bell, and subscriber to actions."""
    actions = topic("action").publish_subscribe(vigil.Action).open().subscriber_builder().create()
    return *sensor(topic), actions


class GraphEnded(Exception):
    """Nobody watches any more."""


class Obedience:
    """What the robot makes of the newest action. Without a valid one it stops."""

    def __init__(self, actions):
        self.actions, self.action, self.is_valid, self.shown = actions, vigil.Action(), False, ""

    def command(self, curvature, speed):
        """The plan as the action has it: curvature, speed, share of the planned speed."""
        while (sample := self.actions.receive()) is not None:
            self.action = vigil.Action.from_buffer_copy(sample.payload().contents)
        action, kind = self.action, KINDS.get(self.action.kind, "none")
        self.is_valid = kind != "none" and time.monotonic_ns() <= action.valid_until_ns
        scale = action.speed_scale if self.is_valid and kind in DRIVING else 0.0
        bent = action.curvature_gain * curvature + action.curvature_offset if scale else curvature
        about = action.stuck_wheels | action.broken_encoders
        wheels = "+".join(wheel for i, wheel in enumerate(WHEELS) if about >> i & 1)
        shown = f"{kind} {wheels}".strip() if self.is_valid else "nothing"
        if shown != self.shown:
            values = f"curvature {curvature:+.2f} -> {bent:+.2f} 1/m, speed {speed:.2f} -> {scale * speed:.2f} m/s"
            print(f"obeys {shown}: {values}", flush=True)
            self.shown = shown
        return bent, scale * speed, scale

    def outcome(self, has_arrived):
        """What to tell about the action."""
        if self.is_valid:
            return vigil.OUTCOME_SUCCEEDED if has_arrived else vigil.OUTCOME_RUNNING
        return vigil.OUTCOME_FAILED if self.action.decision_seq else vigil.OUTCOME_NONE


def change(text):
    """(5.0, "stuck", "RM") of stuck:RM@5; without a time it is due at once."""
    found = re.fullmatch(rf"(stuck|clear)[ :]({'|'.join(WHEELS)})(@\d+(\.\d+)?)?", text.strip())
    if found is None:
        raise argparse.ArgumentTypeError(f"'{text.strip()}': say stuck or clear, and one of {' '.join(WHEELS)}")
    return float((found[3] or "@0")[1:]), found[1], found[2]


def typed():
    """What has been typed, as changes."""
    text = os.read(0, 4096).decode(errors="replace") if sys.stdin and select.select([0], [], [], 0)[0] else ""
    try:
        return [change(line) for line in text.splitlines()]
    except argparse.ArgumentTypeError as error:
        print(error, flush=True)
        return []


def drive(options, rover, viewer):
    publisher = Publisher(options.graph, ports)
    channels, (actions,) = publisher.channels, publisher.further
    obedience, random = Obedience(actions), numpy.random.default_rng(options.seed)
    noise = NOISE * math.sqrt(options.hz / NOISE_HZ)
    period, plan_s, seq, skipped, pending = round(1e9 / options.hz), 0.0, 0, 0, list(options.breaks)
    began = due = time.monotonic_ns()
    print("drives; type `stuck RM` or `clear RM`", flush=True)
    while (t := (due - began) * 1e-9) < options.seconds:
        # A period that was slept through gets no frame, but the world goes on.
        step = max(1, (time.monotonic_ns() - due) // period) * period
        due, seconds, skipped = due + step, step * 1e-9, skipped + step // period - 1
        pending += typed()
        for at, what, wheel in [change for change in pending if change[0] <= t]:
            pending.remove((at, what, wheel))
            rover.stick(WHEELS.index(wheel), what == "stuck")
            print(f"{t:.2f} s: {what} {wheel}", flush=True)
        curvature, speed, share = obedience.command(*planned(plan_s))
        has_arrived = rover.drive(curvature, speed, seconds)
        plan_s += share * seconds
        # Another start is another run: its pose begins anew.
        frame = vigil.SensorFrame(run_id=began, safe_stop=not obedience.is_valid)
        frame.action_seq, frame.action_outcome = obedience.action.decision_seq, obedience.outcome(has_arrived)
        sensed = rover.state() + noise * random.standard_normal(15)
        for name, value in zip(["cmd_curv", "cmd_speed"], rover.command):
            channels.command(frame, name, value)
        for name, value in zip(SENSED, sensed):
            if name is not None:
                channels.set(frame, name, value)
        time.sleep(max(0, due - time.monotonic_ns()) * 1e-9)
        if not publisher.publish(frame, due):
            raise GraphEnded
        seq += 1
        if viewer is not None and seq % 4 == 0:
            viewer.sync()
    print(f"{seq} frames; {skipped} periods were slept through")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--graph", default="rover")
    parser.add_argument("--hz", type=float, default=100.0, help="frames a second, as the graph's rate")
    parser.add_argument("--seconds", type=float, default=math.inf)
    parser.add_argument("--break", dest="breaks", type=change, action="append", default=[], metavar="stuck:RM@5")
    parser.add_argument("--seed", type=int, default=1, help="of the sensors' noise")
    parser.add_argument("--viewer", action="store_true", help="show it (needs a display)")
    options = parser.parse_args()
    rover, viewer = Rover(), None
    if options.viewer:
        import mujoco.viewer

        viewer = mujoco.viewer.launch_passive(rover.model, rover.data)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        drive(options, rover, viewer)
    except KeyboardInterrupt:
        print("interrupted")
    except GraphEnded:
        print(f"graph '{options.graph}' has ended")


if __name__ == "__main__":
    main()
