"""The rover in MuJoCo: geometry and contacts from rover.xml, soil after Janosi and Hanamoto (1961)."""

import math
import pathlib

import mujoco
import numpy

WHEELS = ["LF", "LM", "LR", "RF", "RM", "RR"]
STEERED = [0, 2, 3, 5]
X = numpy.array([0.35, 0.0, -0.35, 0.35, 0.0, -0.35])
Y = numpy.array([0.30, 0.30, 0.30, -0.30, -0.30, -0.30])
RADIUS_M = 0.08
# Shear of the soil: friction coefficient, relative slip at which 63 % of it is there, and the speed below
# which slip counts against this speed.
FRICTION, SHEAR, SPEED_MIN_M_S = 0.65, 0.20, 0.05


def ackermann(curvature, speed):
    """Steering angles and wheel rates for a curvature (1/m, left positive) and a speed."""
    if abs(curvature) < 1e-4:
        return numpy.zeros(6), numpy.full(6, speed / RADIUS_M)
    radius, sign = 1.0 / curvature, math.copysign(1.0, curvature)
    angles = numpy.arctan2(X * sign, (radius - Y) * sign)
    rates = speed * abs(curvature) * numpy.hypot(X, radius - Y) / RADIUS_M
    return numpy.where(X == 0.0, 0.0, angles), rates


class Rover:
    """The rover on its soil. Wheels that are stuck hold still, whatever is commanded."""

    def __init__(self):
        self.model = mujoco.MjModel.from_xml_path(str(pathlib.Path(__file__).with_name("rover.xml")))
        self.data = mujoco.MjData(self.model)
        of = lambda kind, name: mujoco.mj_name2id(self.model, kind, name)
        body, joint, actuator = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_ACTUATOR
        self.base = of(body, "rover")
        self.wheels = [of(body, wheel) for wheel in WHEELS]
        self.legs = [of(body, f"{wheel}_leg") for wheel in WHEELS]
        self.rolls = [self.model.jnt_dofadr[of(joint, f"{wheel}_roll")] for wheel in WHEELS]
        self.steers = [self.model.jnt_qposadr[of(joint, f"{WHEELS[i]}_steer")] for i in STEERED]
        self.roll_motors = [of(actuator, f"{wheel}_roll") for wheel in WHEELS]
        self.steer_motors = [of(actuator, f"{WHEELS[i]}_steer") for i in STEERED]
        self.stuck = numpy.zeros(6, bool)
        self.kv = self.model.actuator_gainprm[self.roll_motors[0], 0]

    def drive(self, curvature, speed, seconds):
        """Goes on for some time under a command."""
        angles, rates = ackermann(curvature, speed)
        self.data.ctrl[self.roll_motors] = numpy.where(self.stuck, 0.0, rates)
        self.data.ctrl[self.steer_motors] = angles[STEERED]
        # A stuck wheel holds with all the torque that it takes.
        gain = numpy.where(self.stuck, 200.0, self.kv)
        self.model.actuator_gainprm[self.roll_motors, 0] = gain
        self.model.actuator_biasprm[self.roll_motors, 2] = -gain
        limit = numpy.where(self.stuck, 100.0, 6.0)
        self.model.actuator_forcerange[self.roll_motors] = numpy.stack([-limit, limit], axis=1)
        for _ in range(max(1, round(seconds / self.model.opt.timestep))):
            mujoco.mj_step1(self.model, self.data)
            self.add_soil()
            mujoco.mj_step2(self.model, self.data)

    def loads(self):
        """Normal force on each wheel, N: that of the last step."""
        loads, force = numpy.zeros(6), numpy.zeros(6)
        for i in range(self.data.ncon):
            contact = self.data.contact[i]
            for geom in (contact.geom1, contact.geom2):
                body = self.model.geom_bodyid[geom]
                if body in self.wheels:
                    mujoco.mj_contactForce(self.model, self.data, i, force)
                    loads[self.wheels.index(body)] += force[0]
        return loads

    def add_soil(self):
        """Shear of the soil on each wheel, by how it slips."""
        data = self.data
        data.qfrc_applied[:] = 0.0
        velocity, torque = numpy.zeros(6), numpy.zeros(3)
        for i, load in enumerate(self.loads()):
            if load <= 0.0:
                continue
            # Heading of the wheel on the ground.
            ahead = data.xmat[self.legs[i]].reshape(3, 3)[:, 0].copy()
            ahead[2] = 0.0
            ahead /= numpy.linalg.norm(ahead)
            aside = numpy.array([-ahead[1], ahead[0], 0.0])
            mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_BODY, self.wheels[i], velocity, 0)
            roll = data.qvel[self.rolls[i]] * RADIUS_M
            along, across = velocity[3:] @ ahead - roll, velocity[3:] @ aside
            slip = math.hypot(along, across) + 1e-9
            speed = max(abs(roll), math.hypot(along + roll, across), SPEED_MIN_M_S)
            shear = load * FRICTION * (1.0 - math.exp(-slip / speed / SHEAR))
            force = -shear / slip * (along * ahead + across * aside)
            point = data.xpos[self.wheels[i]] - numpy.array([0.0, 0.0, RADIUS_M])
            mujoco.mj_applyFT(self.model, data, force, torque, point, self.wheels[i], data.qfrc_applied)

    def pose(self):
        """x, y, yaw."""
        forward = self.data.xmat[self.base].reshape(3, 3)[:, 0]
        x, y, _ = self.data.xpos[self.base]
        return x, y, math.atan2(forward[1], forward[0])

    def rates(self):
        """Wheel rates, rad/s."""
        return self.data.qvel[self.rolls]

    def angles(self):
        """Steering angles, rad; 0 of a wheel without."""
        angles = numpy.zeros(6)
        angles[STEERED] = self.data.qpos[self.steers]
        return angles
