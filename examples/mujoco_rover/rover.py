"""The rover in MuJoCo: body, linkage and motors from rover.xml, soil after Janosi and Hanamoto."""

import math
import pathlib

import mujoco
import numpy

WHEELS = ["LF", "LM", "LR", "RF", "RM", "RR"]
STEERED = [0, 2, 3, 5]
# Where the wheels stand, m: x forward, y left.
X = numpy.array([0.35, 0.0, -0.35, 0.35, 0.0, -0.35])
Y = numpy.array([0.30, 0.30, 0.30, -0.30, -0.30, -0.30])
RADIUS_M = 0.08
# How fast a command may change, 1/m per s and m/s^2, and how far it may go, 1/m and m/s.
RAMP, LIMIT = numpy.array([0.5, 0.5]), numpy.array([1.2, 0.5])
# Soil: friction, slip ratio at which 63 % of it acts, and the least speed that a slip is compared with, m/s.
FRICTION, SHEAR_MODULUS, SPEED_MIN_M_S = 0.65, 0.20, 0.03
# The plan: left, straight, right, straight; seconds, 1/m, m/s.
DRIVE = [(8.0, 0.5, 0.2), (6.0, 0.0, 0.2), (8.0, -0.4, 0.2), (6.0, 0.0, 0.25)]
# Standard deviations of what Rover.state() returns, for a sample at 20 Hz. They grow with the root of the rate:
# a second of samples tells as much at any rate.
NOISE_HZ = 20.0
NOISE = numpy.array([0.005, 0.005, 0.005, *6 * [0.05], 0.003, 0.0, 0.003, 0.003, 0.0, 0.003])
# The same of Rover.effort().
EFFORT_NOISE = numpy.array([0.01, *6 * [0.05]])
CURRENT_A_N_M = 2.0


def ackermann(curvature, speed):
    """Steering angles and wheel rates with which no wheel slips (curvature in 1/m, left positive)."""
    if abs(curvature) < 1e-4:
        return numpy.zeros(6), numpy.full(6, speed / RADIUS_M)
    radius, sign = 1.0 / curvature, math.copysign(1.0, curvature)
    return (
        numpy.arctan2(X * sign, (radius - Y) * sign),
        speed * abs(curvature) * numpy.hypot(X, radius - Y) / RADIUS_M,
    )


def planned(t):
    """Curvature and speed that the plan has for a time, s."""
    t %= sum(seconds for seconds, _, _ in DRIVE)
    for seconds, curvature, speed in DRIVE:
        if t < seconds:
            break
        t -= seconds
    return curvature, speed


class Rover:
    """The rover on its soil."""

    def __init__(self):
        self.model = mujoco.MjModel.from_xml_path(str(pathlib.Path(__file__).with_name("rover.xml")))
        self.data = mujoco.MjData(self.model)
        self.command, self.until_s = numpy.zeros(2), 0.0
        self.wheels = [self.model.body(wheel).id for wheel in WHEELS]
        self.rolls = [self.model.joint(f"{wheel}_roll").dofadr[0] for wheel in WHEELS]
        self.angles_at = [self.model.joint(f"{wheel}_roll").qposadr[0] for wheel in WHEELS]
        self.steers = [self.model.joint(f"{WHEELS[i]}_steer").qposadr[0] for i in STEERED]
        # Let it settle.
        self.drive(0.0, 0.0, 1.0)

    def stick(self, wheel, is_stuck):
        """A stuck wheel keeps the angle that it has, whatever its motor does."""
        jam = self.model.equality(f"{WHEELS[wheel]}_jam").id
        self.model.eq_data[jam, 0] = self.data.qpos[self.angles_at[wheel]]
        self.data.eq_active[jam] = is_stuck

    def drive(self, curvature, speed, seconds):
        """Goes on for some time towards a command, and whether it is reached; `command` is how far it has come."""
        goal = numpy.clip([curvature, speed], -LIMIT, LIMIT)
        self.command += numpy.clip(goal - self.command, -RAMP * seconds, RAMP * seconds)
        angles, rates = ackermann(*self.command)
        # Actuators as in rover.xml: rates of six wheels, angles of the four that steer.
        self.data.ctrl[:6], self.data.ctrl[6:] = rates, angles[STEERED]
        self.until_s += seconds
        while self.data.time < self.until_s - 0.5 * self.model.opt.timestep:
            mujoco.mj_step1(self.model, self.data)
            self.add_soil()
            mujoco.mj_step2(self.model, self.data)
        return bool((self.command == goal).all())

    def add_soil(self):
        """Shear of the soil under each wheel, by how the wheel slips.

        Z. Janosi and B. Hanamoto (1961), "The analytical determination of drawbar pull as a function of slip
        for tracked vehicles": shear = friction * load * (1 - exp(-slip / K)), here against the slip's direction.
        """
        # Sensors as in rover.xml. The loads are those of the last step: this one's are not solved for yet.
        sensors = self.data.sensordata.reshape(6, 7)
        velocity, ahead = sensors[:, 0:2], sensors[:, 3:5]
        ahead = ahead / numpy.linalg.norm(ahead, axis=1, keepdims=True)
        roll = self.data.qvel[self.rolls, None] * RADIUS_M * ahead
        slip = velocity - roll
        speed = numpy.linalg.norm(slip, axis=1) + 1e-9
        reference = numpy.maximum(numpy.linalg.norm([velocity, roll], axis=2).max(axis=0), SPEED_MIN_M_S)
        shear = FRICTION * self.loads() * (1.0 - numpy.exp(-speed / reference / SHEAR_MODULUS))
        force = -(shear / speed)[:, None] * slip
        # It acts on the ground: a force at the hub, and a torque.
        self.data.xfrc_applied[self.wheels, 0:2] = force
        self.data.xfrc_applied[self.wheels, 3:5] = RADIUS_M * force[:, ::-1] * [1.0, -1.0]

    def loads(self):
        """Normal force on each wheel, N."""
        return self.data.sensordata.reshape(6, 7)[:, 6]

    def state(self):
        """What the sensors measure: x, y, yaw, six wheel rates, six steering angles (0 of a wheel without)."""
        body, angles = self.data.body("rover"), numpy.zeros(6)
        angles[STEERED] = self.data.qpos[self.steers]
        yaw = math.atan2(body.xmat[3], body.xmat[0])
        return numpy.array([*body.xpos[:2], yaw, *self.data.qvel[self.rolls], *angles])

    def effort(self):
        """What gyro and motors measure: the body's rate about its own vertical axis, rad/s, and six currents, A."""
        body = self.data.body("rover")
        rate = numpy.dot(body.cvel[:3], body.xmat.reshape(3, 3)[:, 2])
        return numpy.array([rate, *CURRENT_A_N_M * self.data.actuator_force[:6]])
