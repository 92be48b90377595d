"""The newest verdict, and until when the robot may obey it."""

import math

from .wire import vigil_types as vigil

DRIVING = (
    vigil.RECOVERY_GO_ON,
    vigil.RECOVERY_SLOW_DOWN,
    vigil.RECOVERY_COMPENSATE,
    vigil.RECOVERY_IGNORE_ENCODER,
    vigil.RECOVERY_LIMP_HOME,
    vigil.RECOVERY_GO_THROUGH,
    vigil.RECOVERY_MOVE_AWAY,
)
STANDING = (
    vigil.RECOVERY_STOP,
    vigil.RECOVERY_CALL_FOR_HELP,
    vigil.RECOVERY_NEW_PATH,
    vigil.RECOVERY_RELOCALISE,
    vigil.RECOVERY_GIVE_UP,
    vigil.RECOVERY_OWN,
)
# Reasons for which no action is obeyed, as Vigil's own rover has them (`ActionRejection`).
NOTHING, EXPIRED, UNKNOWN_KIND = "nothing", "expired", "unknown-kind"
NOT_FINITE, OUT_OF_RANGE = "not-finite", "out-of-range"


class Newest:
    """The verdict that came last. Times are of a clock that is never set: `time.monotonic()`."""

    def __init__(self):
        self.verdict, self.valid_until_s = None, -math.inf
        self._looked_s = None

    def look(self, publisher, now_s):
        """Takes what has come; True if that is a verdict.

        It may have come any time since the last look, and counts from then: a node that was held up obeys for less
        time, never for more.
        """
        since_s, self._looked_s = (now_s if self._looked_s is None else self._looked_s), now_s
        verdict = publisher.verdict()
        if verdict is None:
            return False
        self.verdict, self.valid_until_s = verdict, since_s + verdict.valid_for_ns * 1e-9
        return True

    def rejection(self, now_s):
        """Why the robot may not obey it now; None if it may."""
        verdict = self.verdict
        if verdict is None:
            return NOTHING
        if now_s > self.valid_until_s or verdict.valid_for_ns == 0:
            return EXPIRED
        if verdict.kind != vigil.RECOVERY_NONE and verdict.kind not in DRIVING + STANDING:
            return UNKNOWN_KIND
        if not all(map(math.isfinite, (verdict.speed_scale, verdict.curvature_gain, verdict.curvature_offset))):
            return NOT_FINITE
        if not 0.0 <= verdict.speed_scale <= 1.0:
            return OUT_OF_RANGE
        return NOTHING if verdict.kind == vigil.RECOVERY_NONE else None

    def driving(self, now_s):
        """The verdict by which the robot may drive now; None if it is to stand."""
        is_driving = self.rejection(now_s) is None and self.verdict.kind in DRIVING
        return self.verdict if is_driving else None
