"""Drives the rover in real time as Vigil's robot: publishes its sensors, obeys Vigil's actions.

pip install iceoryx2==0.10.0 mujoco
scripts/up --source external              # in another window
python3 drive.py [--break stuck:RM@5] [--seconds 20] [--graph rover] [--viewer]
While it drives: type `stuck RM` or `clear RM`, and return.
"""

import argparse
import pathlib
import queue
import sys
import threading
import time

import iceoryx2
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import vigil_types as vigil

from rover import STEERED, WHEELS, Rover

# Left, straight, right, straight: seconds, 1/m, m/s.
DRIVE = [(8.0, 0.5, 0.2), (6.0, 0.0, 0.2), (8.0, -0.4, 0.2), (6.0, 0.0, 0.25)]
# Standard deviations of the sensors for a sample at 20 Hz: m, rad, rad/s, rad.
NOISE_HZ, NOISE = 20.0, (0.005, 0.005, 0.05, 0.003)


def planned(t):
    t %= sum(segment[0] for segment in DRIVE)
    for seconds, curvature, speed in DRIVE:
        if t < seconds:
            return curvature, speed
        t -= seconds


def join(graph):
    """Node, publisher of frames, its bell, and subscriber to actions; waits for the graph."""
    while True:
        try:
            node = iceoryx2.NodeBuilder.new().config(vigil.transport(graph)).create(iceoryx2.ServiceType.Ipc)
            topic = lambda name: node.service_builder(iceoryx2.ServiceName.new(f"vigil/{graph}/{name}"))
            bell = topic("sensor").event().open().notifier_builder().create()
            publisher = topic("sensor").publish_subscribe(vigil.SensorFrame).open().publisher_builder().create()
            actions = topic("action").publish_subscribe(vigil.Action).open().subscriber_builder().create()
            return node, publisher, bell, actions
        except (FileNotFoundError, iceoryx2.EventOpenError, iceoryx2.PublishSubscribeOpenError) as error:
            if "DoesNotExist" not in str(error):
                raise SystemExit(f"{error}: 'vigil check-publisher' says what differs")
            time.sleep(0.1)


class Obedience:
    """What the robot makes of the newest action: without a valid one it stops."""

    STANDS = (vigil.RECOVERY_NONE, vigil.RECOVERY_STOP, vigil.RECOVERY_CALL_FOR_HELP, vigil.RECOVERY_NEW_PATH,
              vigil.RECOVERY_RELOCALISE, vigil.RECOVERY_GIVE_UP)

    def __init__(self):
        self.seq, self.kind, self.until_ns, self.bend, self.scale = 0, vigil.RECOVERY_NONE, 0, (1.0, 0.0), 0.0

    def take(self, actions):
        while (sample := actions.receive()) is not None:
            action = sample.payload().contents
            if action.decision_seq != self.seq:
                print(f"obeys decision {action.decision_seq}: kind {action.kind}, wheel {action.wheel}", flush=True)
            self.seq, self.kind, self.until_ns = action.decision_seq, action.kind, action.valid_until_ns
            self.bend, self.scale = (action.curvature_gain, action.curvature_offset), action.speed_scale

    def command(self, curvature, speed, is_begun):
        """The command to execute, and whether the robot holds itself stopped."""
        if time.monotonic_ns() > self.until_ns:
            # Before the first action there is nothing to obey yet: the graph needs frames to begin.
            return (curvature, 0.0), is_begun
        if self.kind in self.STANDS:
            return (curvature, 0.0), False
        gain, offset = self.bend
        return (gain * curvature + offset, self.scale * speed), False


def breaks(options):
    """Breaks as they are due: (seconds, what, wheel)."""
    return [(float(at), *spec.split(":")) for spec, at in (text.split("@") for text in options)]


def typed(lines):
    for line in sys.stdin:
        lines.put(line.split())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--graph", default="rover")
    parser.add_argument("--hz", type=float, default=100.0)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--break", dest="breaks", action="append", default=[], metavar="stuck:RM@5")
    parser.add_argument("--viewer", action="store_true", help="show it (needs a display)")
    options = parser.parse_args()
    rover, obedience, lines = Rover(), Obedience(), queue.SimpleQueue()
    rover.drive(0.0, 0.0, 1.0)
    pending, random = breaks(options.breaks), numpy.random.default_rng(1)
    node, publisher, bell, actions = join(options.graph)
    threading.Thread(target=typed, args=(lines,), daemon=True).start()
    viewer = None
    if options.viewer:
        import mujoco.viewer

        viewer = mujoco.viewer.launch_passive(rover.model, rover.data)
    print("driving; type `stuck RM` or `clear RM`", flush=True)
    began = due = epoch = time.monotonic_ns()
    scale, late, seq = (options.hz / NOISE_HZ) ** 0.5, 0, 0
    while (t := (due - began) * 1e-9) < options.seconds:
        due += round(1e9 / options.hz)
        obedience.take(actions)
        (curvature, speed), is_stopped = obedience.command(*planned(t), is_begun=obedience.seq > 0)
        rover.drive(curvature, speed, 1.0 / options.hz)
        for at, what, wheel in [b for b in pending if b[0] <= t]:
            lines.put([what, wheel])
        pending = [b for b in pending if b[0] > t]
        while not lines.empty():
            words = lines.get()
            if len(words) == 2 and words[0] in ("stuck", "clear") and words[1] in WHEELS:
                rover.stuck[WHEELS.index(words[1])] = words[0] == "stuck"
                print(f"{t:.3f} s: {' '.join(words)}", flush=True)
        frame = vigil.SensorFrame(run_id=1, safe_stop=int(is_stopped), action_seq=obedience.seq)
        frame.action_outcome = vigil.OUTCOME_RUNNING if obedience.seq else vigil.OUTCOME_NONE
        frame.header.schema, frame.header.epoch, frame.header.seq = vigil.SensorFrame.SCHEMA, epoch, seq
        frame.valid = vigil.VALID_POSE | 3 * vigil.VALID_COMMAND_0 | 0x3F * vigil.VALID_WHEEL_RATE_0
        frame.command[:2] = curvature, speed
        (x, y, yaw), noise = rover.pose(), scale * random.standard_normal(15)
        frame.pose[:] = x + NOISE[0] * noise[0], y + NOISE[0] * noise[1], yaw + NOISE[1] * noise[2]
        frame.wheel_rate[:6] = rover.rates() + NOISE[2] * noise[3:9]
        for i, angle in enumerate(rover.angles() + NOISE[3] * noise[9:15]):
            if i in STEERED:
                frame.steer[i], frame.valid = angle, frame.valid | vigil.VALID_STEER_0 << i
        late += time.monotonic_ns() > due
        time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
        frame.header.t_schedule_ns = frame.header.t_capture_ns = due
        frame.header.t_publish_ns = time.monotonic_ns()
        publisher.loan_uninit().write_payload(frame).send()
        bell.notify()
        seq += 1
        if viewer is not None and seq % 4 == 0:
            viewer.sync()
    print(f"{seq} frames, {late} of them late", flush=True)


if __name__ == "__main__":
    main()
