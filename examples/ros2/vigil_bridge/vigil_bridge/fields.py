"""Finds a number in a message by its path, in the words of `vigil import`.

`twist.twist.linear.x`, or `linear.x`: fields may be left out where one way fits. `velocity[left_wheel]`: by the list
of names beside it. `data[2]`: by its place. `transforms[base_link].transform.x`: the element that has this string.
`orientation.yaw`: an angle of a quaternion. `curvature`: of a twist.
"""

import math
import re

from .message import fields, is_list, is_names, number, numbers_of
from .misfit import Misfit

# Fields that a path may leave out: twists lie two deep in an odometry, its numbers three.
OMITTED_MAX = 4
# Forward speed below which a twist has no curvature.
REST_M_S = 1e-3
STEP = re.compile(r"([^.\[\]]+)|\[([^\]]+)\]")
PATH = re.compile(r"[^.\[\]]+(\[[^\]]+\])*(\.?[^.\[\]]+(\[[^\]]+\])*)*")
QUATERNION = ("x", "y", "z", "w")


def _roll(x, y, z, w):
    return math.atan2(w * x + y * z, 0.5 - x * x - y * y)


def _pitch(x, y, z, w):
    return math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))


def _yaw(x, y, z, w):
    return math.atan2(w * z + x * y, 0.5 - y * y - z * z)


def _curvature(forward, yaw_rate):
    return 0.0 if abs(forward) < REST_M_S else yaw_rate / forward


def _time(sec, nanosec):
    return sec * 1e9 + nanosec


def _one(value):
    return value


# What a type means beside its fields: the numbers that it takes, and what is made of them.
DERIVED = {
    "yaw": [(QUATERNION, _yaw)],
    "pitch": [(QUATERNION, _pitch)],
    "roll": [(QUATERNION, _roll)],
    "curvature": [(("linear.x", "angular.z"), _curvature)],
    **{axis: [((f"{part}.{axis}",), _one) for part in ("position", "translation")] for axis in "xyz"},
}


def steps_of(path):
    """[("pose", None), ("data", "2")] of `pose.data[2]`: each step a name, and the element of a list."""
    if PATH.fullmatch(path) is None:
        raise Misfit(f"'{path}' is no path, such as a.b[2].c")
    steps = []
    for name, key in STEP.findall(path):
        if name:
            steps.append((name, None))
        elif steps[-1][1] is None:
            steps[-1] = (steps[-1][0], key)
        else:
            raise Misfit(f"'{path}' has two elements of one list")
    return steps


class Column:
    """A path as found in a type: `leaves` lead to numbers, of which `combine` makes the value.

    A leaf ends at a number, or at an element of a list and the steps behind it. These are followed in each message
    anew: what a list holds changes.
    """

    def __init__(self, leaves, combine):
        self.leaves, self.combine = leaves, combine

    def within(self, name):
        return Column([(((name, *before)), rest) for before, rest in self.leaves], self.combine)

    def written(self):
        (before, _), *_ = self.leaves
        end = {_yaw: "yaw", _pitch: "pitch", _roll: "roll", _curvature: "curvature"}.get(self.combine)
        cut = 2 if end == "curvature" else 1
        return ".".join([*before[:-cut], end] if end else before)

    def value(self, message):
        """The value; None for what the message does not have. NaN is a value."""
        values = [_follow(message, before, rest) for before, rest in self.leaves]
        return None if None in values else self.combine(*values)


def resolve(message, path):
    """The column of a path in the type of `message`; Misfit for one that leads nowhere, or more than one way."""
    return _find(message, steps_of(path), path)


def _find(message, steps, path):
    for omitted in range(OMITTED_MAX + 1):
        found = _search(message, steps, omitted)
        ways = list(dict.fromkeys(column.written() for column in found))
        if len(ways) > 1:
            raise Misfit(f"'{path}' may be {' or '.join(ways)}: write one")
        if found:
            return found[0]
    there = ", ".join(numbers_of(message)) or "no number"
    raise Misfit(f"there is no '{path}'; there is {there}")


def _search(message, steps, omitted):
    """Every way in which `steps` fit when exactly `omitted` fields are left out."""
    (name, key), rest, own, found = steps[0], steps[1:], fields(message), []
    if name in own:
        value, inner = getattr(message, name), []
        if key is not None:
            # What a list holds is looked at in each message.
            inner = [Column([((), (key, rest))], _one)] if is_list(value) and omitted == 0 else []
        elif rest:
            inner = _search(value, rest, omitted)
        elif omitted == 0:
            inner = _as_number(value)
        found += [column.within(name) for column in inner]
    if omitted == 0:
        if name not in own and key is None and not rest:
            found += _derived(message, name)
        return found
    for field in own:
        if fields(getattr(message, field)):
            found += [column.within(field) for column in _search(getattr(message, field), steps, omitted - 1)]
    return found


def _as_number(value):
    if set(fields(value)) == {"sec", "nanosec"}:
        return [Column([(("sec",), None), (("nanosec",), None)], _time)]
    # A string may be a number in the next message.
    return [Column([((), None)], _one)] if number(value) is not None or isinstance(value, str) else []


def _derived(message, name):
    for parts, combine in DERIVED.get(name, ()):
        leaves = [(tuple(part.split(".")), None) for part in parts]
        if all(_has_number(message, before) for before, _ in leaves):
            return [Column(leaves, combine)]
    return []


def _has_number(message, names):
    for name in names:
        if name not in fields(message):
            return False
        message = getattr(message, name)
    return number(message) is not None and not isinstance(message, str)


def _follow(message, before, rest):
    """The number at the end of a leaf."""
    parent = message
    for name in before:
        parent, message = message, getattr(message, name)
    if rest is None:
        return number(message)
    key, steps = rest
    element = _element(parent, before[-1], message, key)
    if element is None or not steps:
        return number(element)
    path = ".".join(name if inner is None else f"{name}[{inner}]" for name, inner in steps)
    return _find(element, steps, path).value(element)


def _element(parent, name, values, key):
    """The element of a list by its place, by the names beside it, or by a string that it holds."""
    if key.isdigit():
        return values[int(key)] if int(key) < len(values) else None
    if len(values) > 0 and fields(values[0]):
        texts = lambda one: [getattr(one, field) for field in fields(one)]
        return next((one for one in values if any(isinstance(t, str) and t == key for t in texts(one))), None)
    before = fields(parent)[: fields(parent).index(name)]
    lists = [getattr(parent, field) for field in before if is_names(getattr(parent, field))]
    places = [place for place, own in enumerate(lists[-1]) if own == key] if lists else []
    return values[places[0]] if places and places[0] < len(values) else None
