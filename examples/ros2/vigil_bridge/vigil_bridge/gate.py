"""Changes a planner's command as a verdict has it. The rules are those of Vigil's own rover.

Speed is scaled; curvature, which is yaw rate over speed, is changed by a gain and an offset. Without a verdict by
which it may drive the robot stops.
"""

import copy
import math

from .fields import REST_M_S


def twist_of(command):
    """The Twist of a Twist or TwistStamped."""
    return getattr(command, "twist", command)


def stopped(command):
    """The same command at rest."""
    stop = copy.deepcopy(command)
    for part in (twist_of(stop).linear, twist_of(stop).angular):
        part.x = part.y = part.z = 0.0
    return stop


def passed(command, verdict, curvature_max_1_m=0.0):
    """The command as `verdict` has it; None as a verdict stops the robot. The command itself stays as it is."""
    planned = twist_of(command)
    parts = (planned.linear, planned.angular)
    if verdict is None or not all(math.isfinite(v) for part in parts for v in (part.x, part.y, part.z)):
        return stopped(command)
    out, scale = copy.deepcopy(command), verdict.speed_scale
    for part in (twist_of(out).linear, twist_of(out).angular):
        part.x, part.y, part.z = scale * part.x, scale * part.y, scale * part.z
    # A turn in place has no curvature: it is slowed down as it is.
    if abs(planned.linear.x) >= REST_M_S:
        curvature = planned.angular.z / planned.linear.x
        curvature = verdict.curvature_gain * curvature + verdict.curvature_offset
        if curvature_max_1_m > 0.0:
            curvature = max(-curvature_max_1_m, min(curvature_max_1_m, curvature))
        twist_of(out).angular.z = twist_of(out).linear.x * curvature
    return out if math.isfinite(twist_of(out).angular.z) else stopped(command)
