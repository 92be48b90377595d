"""What a verdict says, as the fields of a diagnostic_msgs/DiagnosticStatus, and as JSON.

Names, levels and keys are those of `vigil ros2` (docs/operation.md) where both say the same.
"""

import ctypes
import json
import math

from .newest import EXPIRED, NOTHING, STANDING
from .wire import vigil_types as vigil

# Levels of a DiagnosticStatus.
OK, WARN, ERROR, STALE = range(4)
# Modes from here on are no fault of the tree: unknown, several at once, blind.
MODE_NO_FAULT = 1000
# Causes of blindness, by their codes.
BLIND = ("no", "silence", "clock", "validity", "run", "command", "epoch", "refused", "meaning")
LOST = ("none", "identifier", "detector", "identifier and detector")


def _words(prefix):
    return {value: name[len(prefix) :].lower() for name, value in vars(vigil).items() if name.startswith(prefix)}


KINDS, SIZES = _words("RECOVERY_"), _words("SIZE_")


def _of(words, code):
    return words[code] if code < len(words) else str(code)


def _text(name):
    return name.decode(errors="replace")


def status(newest, now_s, graph, missing=()):
    """Level, message and values of what the graph `graph` says now; `missing`: channels that are not measured."""
    rejection, verdict = newest.rejection(now_s), newest.verdict
    values = [("graph", graph), ("not measured", ", ".join(missing) or "none")]
    if rejection in (NOTHING, EXPIRED):
        said = "no verdict yet" if verdict is None else f"no valid verdict: {rejection}"
        return STALE, f"{said}; the robot is to stop", values + (_values(verdict) if verdict else [])
    values += _values(verdict)
    if rejection is not None:
        return ERROR, f"an action that cannot be obeyed: {rejection}", values
    level, said = _judged(verdict)
    return level, said, values


def _judged(verdict):
    """Level and message of a valid verdict."""
    action, name = _text(verdict.action_name) or KINDS[verdict.kind], _text(verdict.mode_name)
    stands = verdict.kind in STANDING
    if verdict.blind:
        return STALE, f"blind ({_of(BLIND, verdict.blind)}): {action}"
    is_named = 0 < verdict.mode < MODE_NO_FAULT
    if verdict.alarm:
        said = f"{name} p={verdict.p_mode:.2f}" if is_named else f"fault without a name ({name or 'unknown'})"
        return (ERROR if is_named or stands else WARN), f"{said}: {action}"
    if stands:
        return ERROR, f"no alarm: {action}"
    if verdict.lost_stages:
        return WARN, f"lost: {_of(LOST, verdict.lost_stages)}: {action}"
    is_free = verdict.kind == vigil.RECOVERY_GO_ON
    # At its start a graph lets the robot go on more slowly, until it knows more.
    slower = f", at {verdict.speed_scale:.0%} of the speed" if verdict.speed_scale < 1.0 else ""
    return (OK, f"no fault{slower}") if is_free else (WARN, f"no alarm: {action}")


def _numbers(bits):
    """Wheels, by their numbers in the robot's description."""
    return " ".join(str(i) for i in range(16) if bits >> i & 1) or "none"


def _values(verdict):
    """What there is to know, as words."""
    kind = KINDS.get(verdict.kind, str(verdict.kind))
    return [
        ("mode", _text(verdict.mode_name)),
        ("probability", f"{verdict.p_mode:.4f}"),
        ("runner-up", _text(verdict.runner_up_name)),
        ("size", _size(verdict)),
        ("action", _text(verdict.action_name)),
        ("kind of action", kind),
        ("stuck wheels", _numbers(verdict.stuck_wheels)),
        ("broken encoders", _numbers(verdict.broken_encoders)),
        ("speed scale", f"{verdict.speed_scale:.3f}"),
        ("curvature gain", f"{verdict.curvature_gain:.3f}"),
        ("curvature offset, 1/m", f"{verdict.curvature_offset:.4f}"),
        ("p_fault", f"{verdict.p_fault:.3f}"),
        ("alarm", "yes" if verdict.alarm else "no"),
        ("alarms", str(verdict.alarm_count)),
        ("blind", _of(BLIND, verdict.blind)),
        ("lost stages", _of(LOST, verdict.lost_stages)),
        ("decision", str(verdict.decision_seq)),
    ]


def _size(verdict):
    """`gain 0.62 sd 0.03`; the word alone where there is no number, as of what is stuck."""
    word = SIZES.get(verdict.size_kind, str(verdict.size_kind))
    has_number = verdict.size != 0.0 or verdict.size_sd != 0.0
    return f"{word} {verdict.size:.3g} sd {verdict.size_sd:.2g}" if has_number else word


def as_json(verdict):
    """All fields of a verdict, for nodes that want more than `/diagnostics` says."""
    said = {"t_capture_ns": verdict.header.t_capture_ns, "kind_name": KINDS.get(verdict.kind)}
    for name, kind, *_ in verdict._fields_:
        if not issubclass(kind, ctypes.Structure):
            value = getattr(verdict, name)
            # JSON has neither NaN nor infinity.
            is_bad = isinstance(value, float) and not math.isfinite(value)
            said[name] = None if is_bad else _text(value) if isinstance(value, bytes) else value
    return json.dumps(said)
