"""Wire blocks of Vigil, as ctypes. Made by `vigil types python`; do not edit.

Units are SI, angles radians, times CLOCK_MONOTONIC nanoseconds; x forward, y left, yaw
counter-clockwise. All numbers little-endian, no padding. Channels finds the places of a frame's
command and channels by their names.
"""

import ctypes
import importlib.metadata
import os
import struct
import tempfile

SYMPTOM_EPS = 1
SYMPTOM_EPM = 2
SYMPTOM_LD = 4
SYMPTOM_SD = 8
SYMPTOM_BO = 16
SYMPTOM_ALT = 32
SYMPTOM_NNA = 64
OUTCOME_NONE = 0
OUTCOME_RUNNING = 1
OUTCOME_SUCCEEDED = 2
OUTCOME_FAILED = 3
RECOVERY_NONE = 0
RECOVERY_GO_ON = 1
RECOVERY_SLOW_DOWN = 2
RECOVERY_STOP = 3
RECOVERY_COMPENSATE = 4
RECOVERY_IGNORE_ENCODER = 5
RECOVERY_CALL_FOR_HELP = 6
RECOVERY_NEW_PATH = 7
RECOVERY_RELOCALISE = 8
RECOVERY_GO_THROUGH = 9
RECOVERY_MOVE_AWAY = 10
RECOVERY_GIVE_UP = 11
RECOVERY_OWN = 12
RECOVERY_LIMP_HOME = 13
CONTROL_POLICY = 1
CONTROL_DUAL = 2
CONTROL_FALLBACK = 3
CONTROL_SAFE = 4
SIZE_NONE = 0
SIZE_GAIN = 1
SIZE_BIAS_RAD_S = 2
SIZE_DRIFT_RAD_S2 = 3
SIZE_DELAY_S = 4
SIZE_ANGLE_RAD = 5
SIZE_TORQUE_SHARE_LOST = 6
SIZE_CURRENT_OFFSET_A = 7
SIZE_RATE_BIAS_RAD_S = 8
SIZE_ZERO = 9
SIZE_FROZEN = 10
SIZE_NOISE = 11
SIZE_DEAD = 12
SIZE_STUCK = 13
SIZE_HELD_AT_RAD = 14
SIZE_JUMP_M = 15
SIZE_BIAS = 16
SIZE_DRIFT = 17
SIZE_NOISE_RATIO = 18
SIZE_MISSING = 19
SIZE_ERRATIC = 20
SIZE_EFFECT_SHARE_LOST = 21
SIZE_GRIP_SHARE_LOST = 22
SIZE_SPEED_SHARE_ADDED = 23
CAUSE_FRAME = 1
CAUSE_MISSED = 2
IDENTIFYING_CATCHING_UP = 2


class Header(ctypes.LittleEndianStructure):
    _fields_ = [
        # Schema hash of the block (Block::SCHEMA).
        ("schema", ctypes.c_uint64),
        # Identity of the writer's start; differs after each restart, never 0 once written.
        ("epoch", ctypes.c_uint64),
        # Sequence number of the block under its epoch, from 0.
        ("seq", ctypes.c_uint64),
        # Instant at which the sensor cycle behind this block was due, ns, CLOCK_MONOTONIC.
        ("t_schedule_ns", ctypes.c_uint64),
        # Instant at which the data was captured, ns; the recording's own time in a playback. Only its differences have meaning.
        ("t_capture_ns", ctypes.c_uint64),
        # Instant at which the block was handed to the transport, ns, CLOCK_MONOTONIC.
        ("t_publish_ns", ctypes.c_uint64),
    ]


assert ctypes.sizeof(Header) == 48
assert Header.schema.offset == 0
assert Header.epoch.offset == 8
assert Header.seq.offset == 16
assert Header.t_schedule_ns.offset == 24
assert Header.t_capture_ns.offset == 32
assert Header.t_publish_ns.offset == 40


class Cause(ctypes.LittleEndianStructure):
    _fields_ = [
        # A CauseKind.
        ("kind", ctypes.c_uint32),
        # Frames folded into this block (1 if on time), or periods missed.
        ("count", ctypes.c_uint32),
        # Epoch of the newest sensor frame taken.
        ("frame_epoch", ctypes.c_uint64),
        # Sequence number of the newest sensor frame taken.
        ("frame_seq", ctypes.c_uint64),
    ]


assert ctypes.sizeof(Cause) == 24
assert Cause.kind.offset == 0
assert Cause.count.offset == 4
assert Cause.frame_epoch.offset == 8
assert Cause.frame_seq.offset == 16


class FaultSet(ctypes.LittleEndianStructure):
    _fields_ = [
        # Bit i: node i of the tree (always a leaf) is in the set; 0 is the nominal mode.
        ("leaves", ctypes.c_uint64),
        # Probability that exactly this set is present.
        ("p", ctypes.c_double),
    ]


assert ctypes.sizeof(FaultSet) == 16
assert FaultSet.leaves.offset == 0
assert FaultSet.p.offset == 8


class HealthyBelief(ctypes.LittleEndianStructure):
    _fields_ = [
        # Pose: x m, y m, yaw rad.
        ("pose", ctypes.c_double * 3),
        # Its covariance.
        ("pose_covariance", ctypes.c_double * 6),
        # What the motion departs from its model by where the robot drives, per metre: yaw rad/m, forward, lateral. While a fault is suspected: from before it.
        ("deviation", ctypes.c_double * 3),
        # Its covariance.
        ("deviation_covariance", ctypes.c_double * 6),
        # Direction of travel that the deviation is of: 1 forwards, -1 backwards, 0 any.
        ("direction", ctypes.c_double),
        # Share of their rates that all wheels depart by together: mean and variance.
        ("wheel_ratio", ctypes.c_double * 2),
        # Rate by which each wheel departs beside that, rad/s.
        ("wheel_offset", ctypes.c_double * 8),
        # Its variance.
        ("wheel_offset_variance", ctypes.c_double * 8),
    ]


assert ctypes.sizeof(HealthyBelief) == 296
assert HealthyBelief.pose.offset == 0
assert HealthyBelief.pose_covariance.offset == 24
assert HealthyBelief.deviation.offset == 72
assert HealthyBelief.deviation_covariance.offset == 96
assert HealthyBelief.direction.offset == 144
assert HealthyBelief.wheel_ratio.offset == 152
assert HealthyBelief.wheel_offset.offset == 168
assert HealthyBelief.wheel_offset_variance.offset == 232


class WeightedHypothesis(ctypes.LittleEndianStructure):
    _fields_ = [
        # Set of faults: bit i is node i of the fault tree (always a leaf); 0 is none, or unknown.
        ("leaves", ctypes.c_uint64),
        # Since when it holds, capture time ns; 0 for nominal, and where no alarm stands.
        ("onset_t_capture_ns", ctypes.c_uint64),
        # Mean pose: x m, y m, yaw rad (not wrapped). Zero where no pose is tracked.
        ("pose", ctypes.c_double * 3),
        # Its covariance: upper triangle, row by row; zero for a sampled particle.
        ("pose_covariance", ctypes.c_double * 6),
        # Natural logarithm of its probability.
        ("log_weight", ctypes.c_double),
        # Index into the fault tree's nodes (0 is nominal), MODE_UNKNOWN or MODE_MULTIPLE.
        ("mode", ctypes.c_uint32),
        # Reserved, zero.
        ("reserved", ctypes.c_uint32),
    ]


assert ctypes.sizeof(WeightedHypothesis) == 104
assert WeightedHypothesis.leaves.offset == 0
assert WeightedHypothesis.onset_t_capture_ns.offset == 8
assert WeightedHypothesis.pose.offset == 16
assert WeightedHypothesis.pose_covariance.offset == 40
assert WeightedHypothesis.log_weight.offset == 88
assert WeightedHypothesis.mode.offset == 96
assert WeightedHypothesis.reserved.offset == 100


class Event(ctypes.LittleEndianStructure):
    _fields_ = [
        # When, CLOCK_MONOTONIC ns.
        ("t_ns", ctypes.c_uint64),
        # An EventKind.
        ("kind", ctypes.c_uint32),
        # See EventKind.
        ("what", ctypes.c_uint32),
        # Probability, where the event has one; else as EventKind says, or 0.
        ("p", ctypes.c_double),
        # See EventKind.
        ("value", ctypes.c_uint64),
    ]


assert ctypes.sizeof(Event) == 32
assert Event.t_ns.offset == 0
assert Event.kind.offset == 8
assert Event.what.offset == 12
assert Event.p.offset == 16
assert Event.value.offset == 24


class FaultRecord(ctypes.LittleEndianStructure):
    _fields_ = [
        # Counts the graph's faults, from 1; 0: this place is free.
        ("number", ctypes.c_uint64),
        # When it was present first, ns.
        ("first_ns", ctypes.c_uint64),
        # When it was present last, ns.
        ("last_ns", ctypes.c_uint64),
        # When its state changed last, ns.
        ("changed_ns", ctypes.c_uint64),
        # Probability when it was present last.
        ("p", ctypes.c_double),
        # Expected size then, in the unit of size_kind; 0 without one.
        ("size", ctypes.c_double),
        # Its standard deviation.
        ("size_sd", ctypes.c_double),
        # Evidence of evidence_channel then, nat.
        ("evidence", ctypes.c_double),
        # Freeze frame: capture time of the frame nearest to the onset of the most probable fault, ns; 0 without one.
        ("frame_t_capture_ns", ctypes.c_uint64),
        # See SensorFrame::channel_valid, of the freeze frame.
        ("channel_valid", ctypes.c_uint64),
        # Its channels.
        ("channel", ctypes.c_double * 48),
        # Its command.
        ("command", ctypes.c_double * 8),
        # Where it lies: a FaultSource.
        ("source", ctypes.c_uint32),
        # Of the robot: a node of the fault tree or MODE_UNKNOWN. Of an input: a Blindness. Of a service: its index in the order of the data.
        ("what", ctypes.c_uint32),
        # A FaultState.
        ("state", ctypes.c_uint32),
        # A Severity.
        ("severity", ctypes.c_uint32),
        # How often it became active.
        ("count", ctypes.c_uint32),
        # A SizeKind.
        ("size_kind", ctypes.c_uint32),
        # The channel that spoke most for it; see Evidence.
        ("evidence_channel", ctypes.c_uint32),
        # The next best explanation: a mode, as in FaultBelief::runner_up.
        ("runner_up", ctypes.c_uint32),
        # What was done about it last: an action of the decision model.
        ("action", ctypes.c_uint32),
        # See SensorFrame::command_valid, of the freeze frame.
        ("command_valid", ctypes.c_uint32),
        # 1 if it stays until somebody acknowledges it.
        ("latches", ctypes.c_uint32),
        # Reserved, zero.
        ("reserved", ctypes.c_uint32),
    ]


assert ctypes.sizeof(FaultRecord) == 576
assert FaultRecord.number.offset == 0
assert FaultRecord.first_ns.offset == 8
assert FaultRecord.last_ns.offset == 16
assert FaultRecord.changed_ns.offset == 24
assert FaultRecord.p.offset == 32
assert FaultRecord.size.offset == 40
assert FaultRecord.size_sd.offset == 48
assert FaultRecord.evidence.offset == 56
assert FaultRecord.frame_t_capture_ns.offset == 64
assert FaultRecord.channel_valid.offset == 72
assert FaultRecord.channel.offset == 80
assert FaultRecord.command.offset == 464
assert FaultRecord.source.offset == 528
assert FaultRecord.what.offset == 532
assert FaultRecord.state.offset == 536
assert FaultRecord.severity.offset == 540
assert FaultRecord.count.offset == 544
assert FaultRecord.size_kind.offset == 548
assert FaultRecord.evidence_channel.offset == 552
assert FaultRecord.runner_up.offset == 556
assert FaultRecord.action.offset == 560
assert FaultRecord.command_valid.offset == 564
assert FaultRecord.latches.offset == 568
assert FaultRecord.reserved.offset == 572


class Carryover(ctypes.LittleEndianStructure):
    _fields_ = [
        # The run.
        ("run_id", ctypes.c_uint64),
        # Capture time of the frame that raised the detector's alarm, ns; 0 while none stands.
        ("detected_t_capture_ns", ctypes.c_uint64),
        # The detector's probability of a fault.
        ("p_fault", ctypes.c_double),
        # See Action::alarm_t_capture_ns.
        ("alarm_t_capture_ns", ctypes.c_uint64),
        # Hash of the decision model.
        ("model_hash", ctypes.c_uint64),
        # See Action::alarm_count.
        ("alarm_count", ctypes.c_uint32),
        # 1 + the action of the decision model that stands until a new run, whatever is believed; 0 without one.
        ("latched", ctypes.c_uint32),
    ]


assert ctypes.sizeof(Carryover) == 48
assert Carryover.run_id.offset == 0
assert Carryover.detected_t_capture_ns.offset == 8
assert Carryover.p_fault.offset == 16
assert Carryover.alarm_t_capture_ns.offset == 24
assert Carryover.model_hash.offset == 32
assert Carryover.alarm_count.offset == 40
assert Carryover.latched.offset == 44


class SensorFrame(ctypes.LittleEndianStructure):
    SCHEMA = 0xE54EE7C97147DECD
    TYPE_NAME = "vigil.SensorFrame.v1.e54ee7c97147decd"

    @staticmethod
    def type_name():
        return SensorFrame.TYPE_NAME

    _fields_ = [
        # Common header; t_schedule_ns is when this cycle was due.
        ("header", Header),
        # Identity of the run; a new value resets every filter.
        ("run_id", ctypes.c_uint64),
        # Which command and channels the numbers mean: the hash of the robot's channel list. A frame with another one is refused.
        ("robot_hash", ctypes.c_uint64),
        # Bit i: channel[i] holds a measurement.
        ("channel_valid", ctypes.c_uint64),
        # decision_seq of the last Action that the robot obeyed; 0 for none.
        ("action_seq", ctypes.c_uint64),
        # Outcome of that action: an ActionOutcome.
        ("action_outcome", ctypes.c_uint32),
        # Symptoms reported by monitors outside Vigil: bits of Symptoms.
        ("symptoms", ctypes.c_uint32),
        # Counts jumps of the pose's frame (relocalisation): a new value re-anchors the track.
        ("pose_reset_count", ctypes.c_uint32),
        # 1 while the robot holds itself stopped because it has no valid action.
        ("safe_stop", ctypes.c_uint32),
        # Bit i: command[i] is known.
        ("command_valid", ctypes.c_uint32),
        # 1 if planned_pose is known.
        ("planned_pose_valid", ctypes.c_uint32),
        # The command as executed; the robot's description gives its axes and units. Rover: signed curvature 1/m (left +), speed m/s.
        ("command", ctypes.c_double * 8),
        # Measurements, in the order of the robot's channel list, in the units that it gives; 0 where nothing was measured.
        ("channel", ctypes.c_double * 48),
        # Planned pose x m, y m, yaw rad, in the frame of the pose's channels.
        ("planned_pose", ctypes.c_double * 3),
    ]


assert ctypes.sizeof(SensorFrame) == 576
assert SensorFrame.header.offset == 0
assert SensorFrame.run_id.offset == 48
assert SensorFrame.robot_hash.offset == 56
assert SensorFrame.channel_valid.offset == 64
assert SensorFrame.action_seq.offset == 72
assert SensorFrame.action_outcome.offset == 80
assert SensorFrame.symptoms.offset == 84
assert SensorFrame.pose_reset_count.offset == 88
assert SensorFrame.safe_stop.offset == 92
assert SensorFrame.command_valid.offset == 96
assert SensorFrame.planned_pose_valid.offset == 100
assert SensorFrame.command.offset == 104
assert SensorFrame.channel.offset == 168
assert SensorFrame.planned_pose.offset == 552


class DetectionBelief(ctypes.LittleEndianStructure):
    SCHEMA = 0xAA8CF898B07DABD6
    TYPE_NAME = "vigil.DetectionBelief.v1.aa8cf898b07dabd6"

    @staticmethod
    def type_name():
        return DetectionBelief.TYPE_NAME

    _fields_ = [
        # Common header.
        ("header", Header),
        # The journal entry behind this belief.
        ("cause", Cause),
        # Run of the frame.
        ("run_id", ctypes.c_uint64),
        # Probability that the robot is not in its nominal mode.
        ("p_fault", ctypes.c_double),
        # Its log-odds, natural logarithm.
        ("log_odds", ctypes.c_double),
        # Log-odds at which the alarm rises (calibrated; natural logarithm).
        ("alarm_log_odds", ctypes.c_double),
        # Log-likelihood of this frame under the nominal mode, natural logarithm.
        ("evidence", ctypes.c_double),
        # Estimated ratio of the noise of the pose (x, y, yaw) to the learned one (standard deviations).
        ("noise_scale", ctypes.c_double * 3),
        # The same for each wheel's rate.
        ("noise_scale_wheels", ctypes.c_double * 8),
        # The same for each steering angle.
        ("noise_scale_steer", ctypes.c_double * 8),
        # Estimated share of the samples of the pose (x, y, yaw) that are outliers.
        ("outlier_rate", ctypes.c_double * 3),
        # The same for each wheel's rate.
        ("outlier_rate_wheels", ctypes.c_double * 8),
        # The same for each steering angle.
        ("outlier_rate_steer", ctypes.c_double * 8),
        # Log-odds of a fault seen by each channel alone (see Evidence).
        ("channel_log_odds", ctypes.c_double * 50),
        # decision_seq of the last action that the robot obeyed, as the frame says it.
        ("action_seq", ctypes.c_uint64),
        # Capture time of the frame that raised the present alarm, ns; 0 without alarm.
        ("alarm_t_capture_ns", ctypes.c_uint64),
        # 1 while the alarm stands.
        ("alarm", ctypes.c_uint32),
        # Alarms raised so far.
        ("alarm_count", ctypes.c_uint32),
        # Symptoms: the detector's own or-ed with external ones (see Symptoms).
        ("symptoms", ctypes.c_uint32),
        # Frames refused by the filter because a channel was not finite or out of range.
        ("invalid_count", ctypes.c_uint32),
        # Steps whose weights degenerated (coasted, or re-initialised).
        ("degenerate_count", ctypes.c_uint32),
        # Outcome of that action, as the frame says it: an ActionOutcome.
        ("action_outcome", ctypes.c_uint32),
        # Why the detector sees nothing: a Blindness; 0 while it sees.
        ("blind", ctypes.c_uint32),
        # Whether an alarm could rise now: a Readiness.
        ("readiness", ctypes.c_uint32),
        # When the last change came that is no fault, capture time, ns; 0 before the first one.
        ("context_t_capture_ns", ctypes.c_uint64),
        # Such changes told so far.
        ("context_count", ctypes.c_uint32),
        # Which of the description's contexts the last one was, from 0.
        ("context", ctypes.c_uint32),
    ]


assert ctypes.sizeof(DetectionBelief) == 880
assert DetectionBelief.header.offset == 0
assert DetectionBelief.cause.offset == 48
assert DetectionBelief.run_id.offset == 72
assert DetectionBelief.p_fault.offset == 80
assert DetectionBelief.log_odds.offset == 88
assert DetectionBelief.alarm_log_odds.offset == 96
assert DetectionBelief.evidence.offset == 104
assert DetectionBelief.noise_scale.offset == 112
assert DetectionBelief.noise_scale_wheels.offset == 136
assert DetectionBelief.noise_scale_steer.offset == 200
assert DetectionBelief.outlier_rate.offset == 264
assert DetectionBelief.outlier_rate_wheels.offset == 288
assert DetectionBelief.outlier_rate_steer.offset == 352
assert DetectionBelief.channel_log_odds.offset == 416
assert DetectionBelief.action_seq.offset == 816
assert DetectionBelief.alarm_t_capture_ns.offset == 824
assert DetectionBelief.alarm.offset == 832
assert DetectionBelief.alarm_count.offset == 836
assert DetectionBelief.symptoms.offset == 840
assert DetectionBelief.invalid_count.offset == 844
assert DetectionBelief.degenerate_count.offset == 848
assert DetectionBelief.action_outcome.offset == 852
assert DetectionBelief.blind.offset == 856
assert DetectionBelief.readiness.offset == 860
assert DetectionBelief.context_t_capture_ns.offset == 864
assert DetectionBelief.context_count.offset == 872
assert DetectionBelief.context.offset == 876


class ParticleBlock(ctypes.LittleEndianStructure):
    SCHEMA = 0x60E41525A1AEF4B2
    TYPE_NAME = "vigil.ParticleBlock.v1.60e41525a1aef4b2"

    @staticmethod
    def type_name():
        return ParticleBlock.TYPE_NAME

    _fields_ = [
        # Common header.
        ("header", Header),
        # The journal entry behind these hypotheses.
        ("cause", Cause),
        # Hypotheses in use; the rest of the array is unspecified.
        ("count", ctypes.c_uint32),
        # Reserved, zero.
        ("reserved", ctypes.c_uint32),
        # What an identification starts from; zero while one is under way.
        ("healthy", HealthyBelief),
        # The hypotheses.
        ("hypotheses", WeightedHypothesis * 1024),
    ]


assert ctypes.sizeof(ParticleBlock) == 106872
assert ParticleBlock.header.offset == 0
assert ParticleBlock.cause.offset == 48
assert ParticleBlock.count.offset == 72
assert ParticleBlock.reserved.offset == 76
assert ParticleBlock.healthy.offset == 80
assert ParticleBlock.hypotheses.offset == 376


class FaultBelief(ctypes.LittleEndianStructure):
    SCHEMA = 0x43A94BF286DEB000
    TYPE_NAME = "vigil.FaultBelief.v1.43a94bf286deb000"

    @staticmethod
    def type_name():
        return FaultBelief.TYPE_NAME

    _fields_ = [
        # Common header.
        ("header", Header),
        # The journal entry behind this belief.
        ("cause", Cause),
        # Run of the frame.
        ("run_id", ctypes.c_uint64),
        # Hash of the fault tree that gives the nodes their meaning.
        ("tree_hash", ctypes.c_uint64),
        # Probability of each node: that a leaf's fault is present, alone or with others; that any fault below an abstract node is. Node 0 is nominal: no fault at all.
        ("p", ctypes.c_double * 64),
        # The same before this cycle's data: prediction from the last cycle.
        ("p_predicted", ctypes.c_double * 64),
        # Probability that no modelled fault explains the data.
        ("p_unknown", ctypes.c_double),
        # The same before this cycle's data.
        ("p_unknown_predicted", ctypes.c_double),
        # Most probable sets of leaves, in falling order.
        ("sets", FaultSet * 8),
        # Entropy of the distribution over sets and unknown, nats.
        ("entropy", ctypes.c_double),
        # Why this diagnosis and not the next best one: by channel, how much more the readings since the onset are expected under it than under runner_up, natural log-likelihood; see Evidence. 0 while nothing is diagnosed.
        ("channel_evidence", ctypes.c_double * 50),
        # Expected size of each node's fault, given that it is present, in the unit of its size_kind; 0 without a size.
        ("size", ctypes.c_double * 64),
        # Standard deviation of size, in the same unit.
        ("size_sd", ctypes.c_double * 64),
        # Probability of mode.
        ("p_mode", ctypes.c_double),
        # Capture time of the frame that raised the alarm, ns; 0 before an alarm.
        ("alarm_t_capture_ns", ctypes.c_uint64),
        # Most probable onset of the most probable fault, capture time ns; 0 if none.
        ("onset_t_capture_ns", ctypes.c_uint64),
        # Mode, memoryless: a node's index, MODE_UNKNOWN, MODE_MULTIPLE or MODE_BLIND.
        ("mode", ctypes.c_uint32),
        # Reported mode: follows mode with hysteresis.
        ("reported", ctypes.c_uint32),
        # Changes of reported so far.
        ("reported_change_count", ctypes.c_uint32),
        # The next best explanation that is not the best and one more fault: a node's index (0 is nominal), MODE_UNKNOWN or MODE_MULTIPLE.
        ("runner_up", ctypes.c_uint32),
        # Particles or hypotheses allowed at present; fewer than configured while time is short.
        ("particle_limit", ctypes.c_uint32),
        # Changes of mode so far.
        ("mode_change_count", ctypes.c_uint32),
        # Nodes in use.
        ("node_count", ctypes.c_uint32),
        # Sets in use.
        ("set_count", ctypes.c_uint32),
        # 1 while identifying (an alarm stands or a fault is believed), CATCHING_UP before the first result of that; 0 while watching, or while nothing is known yet of an alarm that stood before the identifier began.
        ("identifying", ctypes.c_uint32),
        # Steps that met impossible or non-finite evidence and kept the prediction.
        ("degenerate_count", ctypes.c_uint32),
        # In which way each node's component is most probably broken, given that it is: a SizeKind, which gives size its unit.
        ("size_kind", ctypes.c_uint32 * 64),
    ]


assert ctypes.sizeof(FaultBelief) == 3008
assert FaultBelief.header.offset == 0
assert FaultBelief.cause.offset == 48
assert FaultBelief.run_id.offset == 72
assert FaultBelief.tree_hash.offset == 80
assert FaultBelief.p.offset == 88
assert FaultBelief.p_predicted.offset == 600
assert FaultBelief.p_unknown.offset == 1112
assert FaultBelief.p_unknown_predicted.offset == 1120
assert FaultBelief.sets.offset == 1128
assert FaultBelief.entropy.offset == 1256
assert FaultBelief.channel_evidence.offset == 1264
assert FaultBelief.size.offset == 1664
assert FaultBelief.size_sd.offset == 2176
assert FaultBelief.p_mode.offset == 2688
assert FaultBelief.alarm_t_capture_ns.offset == 2696
assert FaultBelief.onset_t_capture_ns.offset == 2704
assert FaultBelief.mode.offset == 2712
assert FaultBelief.reported.offset == 2716
assert FaultBelief.reported_change_count.offset == 2720
assert FaultBelief.runner_up.offset == 2724
assert FaultBelief.particle_limit.offset == 2728
assert FaultBelief.mode_change_count.offset == 2732
assert FaultBelief.node_count.offset == 2736
assert FaultBelief.set_count.offset == 2740
assert FaultBelief.identifying.offset == 2744
assert FaultBelief.degenerate_count.offset == 2748
assert FaultBelief.size_kind.offset == 2752


class Action(ctypes.LittleEndianStructure):
    SCHEMA = 0x07B60509A93BC403
    TYPE_NAME = "vigil.Action.v1.07b60509a93bc403"

    @staticmethod
    def type_name():
        return Action.TYPE_NAME

    _fields_ = [
        # Common header.
        ("header", Header),
        # The journal entry behind this decision.
        ("cause", Cause),
        # Run of the frame.
        ("run_id", ctypes.c_uint64),
        # Counts decisions: rises when action or its parameters change. From 1.
        ("decision_seq", ctypes.c_uint64),
        # CLOCK_MONOTONIC ns after which the robot must no longer obey this block, but stop.
        ("valid_until_ns", ctypes.c_uint64),
        # Hash of the decision model that gives states and actions their meaning.
        ("model_hash", ctypes.c_uint64),
        # Belief over the decision model's states.
        ("belief", ctypes.c_double * 64),
        # What the policy thinks of each action, the larger the better; value_kind says what it is. Finite.
        ("value", ctypes.c_double * 32),
        # Entropy of the belief, normalised to 0..1.
        ("entropy", ctypes.c_double),
        # Entropy of the states' votes for their best actions, normalised to 0..1: doubt about what to do.
        ("action_entropy", ctypes.c_double),
        # Value of the chosen action minus the runner-up's.
        ("margin", ctypes.c_double),
        # How well the last evidence was predicted: with symptoms the natural logarithm of its probability; with faults the mean of that of the predicted belief, over the belief.
        ("log_evidence", ctypes.c_double),
        # Speed factor to apply, 0..1.
        ("speed_scale", ctypes.c_double),
        # Curvature to command: curvature_gain * curvature + curvature_offset.
        ("curvature_gain", ctypes.c_double),
        # See curvature_gain; 1/m.
        ("curvature_offset", ctypes.c_double),
        # Index of the chosen action in the decision model.
        ("action", ctypes.c_uint32),
        # What the robot is to do: a RecoveryKind.
        ("kind", ctypes.c_uint32),
        # Stuck wheels that the action is about, as bits in the order of the robot's wheels.
        ("stuck_wheels", ctypes.c_uint16),
        # Wheels whose encoders are not to be trusted, as bits.
        ("broken_encoders", ctypes.c_uint16),
        # How the action was chosen: a ControlMode.
        ("control_mode", ctypes.c_uint32),
        # States in use.
        ("state_count", ctypes.c_uint32),
        # Actions in use.
        ("action_count", ctypes.c_uint32),
        # Observations that were impossible under the belief so far.
        ("impossible_count", ctypes.c_uint32),
        # Bit 0: identifier lost; bit 1: detector lost.
        ("lost_stages", ctypes.c_uint32),
        # What value is: a ValueKind.
        ("value_kind", ctypes.c_uint32),
        # 1 while the alarm stands: the detector's, unless the identifier has found the robot nominal since.
        ("alarm", ctypes.c_uint32),
        # Capture time of the frame that raised it, ns; 0 without alarm.
        ("alarm_t_capture_ns", ctypes.c_uint64),
        # Alarms raised so far.
        ("alarm_count", ctypes.c_uint32),
        # Why nothing is seen: a Blindness; 0 while something is.
        ("blind", ctypes.c_uint32),
        # Which belief the model's last step was of: how many had begun anew before, at a reset or at a new run that was not the success of an action.
        ("step_belief", ctypes.c_uint64),
        # Steps of the decision model so far, with symptoms; 0 with faults, whose evidence is no observation of the model.
        ("step_count", ctypes.c_uint64),
        # Action of the model's last step.
        ("step_action", ctypes.c_uint32),
        # Observation of the model's last step; u32::MAX for a set of symptoms that the model does not have.
        ("step_observation", ctypes.c_uint32),
    ]


assert ctypes.sizeof(Action) == 1008
assert Action.header.offset == 0
assert Action.cause.offset == 48
assert Action.run_id.offset == 72
assert Action.decision_seq.offset == 80
assert Action.valid_until_ns.offset == 88
assert Action.model_hash.offset == 96
assert Action.belief.offset == 104
assert Action.value.offset == 616
assert Action.entropy.offset == 872
assert Action.action_entropy.offset == 880
assert Action.margin.offset == 888
assert Action.log_evidence.offset == 896
assert Action.speed_scale.offset == 904
assert Action.curvature_gain.offset == 912
assert Action.curvature_offset.offset == 920
assert Action.action.offset == 928
assert Action.kind.offset == 932
assert Action.stuck_wheels.offset == 936
assert Action.broken_encoders.offset == 938
assert Action.control_mode.offset == 940
assert Action.state_count.offset == 944
assert Action.action_count.offset == 948
assert Action.impossible_count.offset == 952
assert Action.lost_stages.offset == 956
assert Action.value_kind.offset == 960
assert Action.alarm.offset == 964
assert Action.alarm_t_capture_ns.offset == 968
assert Action.alarm_count.offset == 976
assert Action.blind.offset == 980
assert Action.step_belief.offset == 984
assert Action.step_count.offset == 992
assert Action.step_action.offset == 1000
assert Action.step_observation.offset == 1004


class Truth(ctypes.LittleEndianStructure):
    SCHEMA = 0x31E8FD77EDE8C9AD
    TYPE_NAME = "vigil.Truth.v1.31e8fd77ede8c9ad"

    @staticmethod
    def type_name():
        return Truth.TYPE_NAME

    _fields_ = [
        # Common header.
        ("header", Header),
        # The frame of this instant.
        ("cause", Cause),
        # Run of that frame.
        ("run_id", ctypes.c_uint64),
        # Pose in the world: x m, y m, yaw rad (not wrapped).
        ("pose", ctypes.c_double * 3),
        # Velocity of the body: forward m/s, lateral m/s, yaw rad/s.
        ("velocity", ctypes.c_double * 3),
        # What was obeyed since the frame before: a RecoveryKind; 0 if no action was valid.
        ("obeyed", ctypes.c_uint32),
        # See Action::stuck_wheels, of the obeyed action.
        ("stuck_wheels", ctypes.c_uint16),
        # See Action::broken_encoders, of the obeyed action.
        ("broken_encoders", ctypes.c_uint16),
        # 1 while a fault or disturbance is in force.
        ("is_disturbed", ctypes.c_uint32),
        # 1 while something is within the bumper's reach.
        ("touches", ctypes.c_uint32),
        # 1 once the navigation holds its goal for reached.
        ("at_goal", ctypes.c_uint32),
        # Reserved, zero.
        ("reserved", ctypes.c_uint32),
    ]


assert ctypes.sizeof(Truth) == 152
assert Truth.header.offset == 0
assert Truth.cause.offset == 48
assert Truth.run_id.offset == 72
assert Truth.pose.offset == 80
assert Truth.velocity.offset == 104
assert Truth.obeyed.offset == 128
assert Truth.stuck_wheels.offset == 132
assert Truth.broken_encoders.offset == 134
assert Truth.is_disturbed.offset == 136
assert Truth.touches.offset == 140
assert Truth.at_goal.offset == 144
assert Truth.reserved.offset == 148


class Faults(ctypes.LittleEndianStructure):
    SCHEMA = 0x1C29BB227971E917
    TYPE_NAME = "vigil.Faults.v1.1c29bb227971e917"

    @staticmethod
    def type_name():
        return Faults.TYPE_NAME

    _fields_ = [
        # Common header.
        ("header", Header),
        # Hash of the fault tree that gives the nodes their names.
        ("tree_hash", ctypes.c_uint64),
        # Rises with each change of a fault or of the overall state.
        ("revision", ctypes.c_uint64),
        # Faults so far, kept or not.
        ("fault_count", ctypes.c_uint64),
        # What is present and has no place.
        ("dropped_count", ctypes.c_uint32),
        # The overall state: an OverallState.
        ("overall", ctypes.c_uint32),
        # What the next supervisor goes on from.
        ("carryover", Carryover),
        # The faults, in no order.
        ("records", FaultRecord * 16),
    ]


assert ctypes.sizeof(Faults) == 9344
assert Faults.header.offset == 0
assert Faults.tree_hash.offset == 48
assert Faults.revision.offset == 56
assert Faults.fault_count.offset == 64
assert Faults.dropped_count.offset == 72
assert Faults.overall.offset == 76
assert Faults.carryover.offset == 80
assert Faults.records.offset == 128


class Health(ctypes.LittleEndianStructure):
    SCHEMA = 0x22CA8E52D533DF67
    TYPE_NAME = "vigil.Health.v1.22ca8e52d533df67"

    @staticmethod
    def type_name():
        return Health.TYPE_NAME

    _fields_ = [
        # Common header.
        ("header", Header),
        # Cycles done: blocks published, or frames for the source.
        ("cycles", ctypes.c_uint64),
        # Scheduled cycles whose deadline passed before the block was out.
        ("missed", ctypes.c_uint64),
        # Cycles whose time from wake-up to publication exceeded the budget.
        ("over_budget", ctypes.c_uint64),
        # Schedule instants that the source slept through.
        ("slips", ctypes.c_uint64),
        # Input blocks that never arrived, by gaps of their sequence numbers.
        ("lost", ctypes.c_uint64),
        # Input blocks that arrived after their deadline.
        ("late", ctypes.c_uint64),
        # Input blocks that arrived twice.
        ("duplicate", ctypes.c_uint64),
        # Input blocks refused: wrong schema, impossible time stamps, non-finite data.
        ("invalid", ctypes.c_uint64),
        # The refused ones by cause, see Rejection.
        ("rejected", ctypes.c_uint64 * 16),
        # Longest time from wake-up to publication, ns.
        ("worst_cycle_ns", ctypes.c_uint64),
        # Sequence number of that cycle.
        ("worst_cycle_seq", ctypes.c_uint64),
        # Last time from wake-up to publication, ns.
        ("last_cycle_ns", ctypes.c_uint64),
        # Period of the schedule, ns.
        ("period_ns", ctypes.c_uint64),
        # Deadline after the schedule, ns.
        ("deadline_ns", ctypes.c_uint64),
        # Budget of one cycle, from wake-up to publication, ns.
        ("budget_ns", ctypes.c_uint64),
        # Schedule instant of the service's first and last accounted cycle, ns.
        ("accounted_ns", ctypes.c_uint64 * 2),
        # A ServiceState.
        ("state", ctypes.c_uint32),
        # Core that was asked for.
        ("core_wanted", ctypes.c_uint32),
        # Core that the kernel reported in the last check.
        ("core", ctypes.c_uint32),
        # 1 if the kernel lets the service run on no other core than core_wanted.
        ("pinned", ctypes.c_uint32),
        # Scheduling policy read back (SCHED_FIFO is 1, SCHED_OTHER 0).
        ("policy", ctypes.c_uint32),
        # Priority read back.
        ("priority", ctypes.c_uint32),
        # 1 if all memory is locked.
        ("memory_locked", ctypes.c_uint32),
        # Process id.
        ("pid", ctypes.c_uint32),
        # Why the service is in degraded mode, bits of Degraded; 0 if it is not.
        ("degraded", ctypes.c_uint32),
        # Result of the last control command: 1 done, 2 refused, 0 none yet.
        ("control_result", ctypes.c_uint32),
        # Sequence number of the last control command handled.
        ("control_seq", ctypes.c_uint64),
        # Epoch of the writer of that command.
        ("control_epoch", ctypes.c_uint64),
        # Writer and sequence number of the newest sensor frame that an output has answered.
        ("answered_epoch", ctypes.c_uint64),
        # See answered_epoch.
        ("answered_seq", ctypes.c_uint64),
        # Hypotheses or particles that the time allows at present; 0 without any to shed.
        ("particles", ctypes.c_uint32),
        # Hypotheses or particles configured.
        ("particles_configured", ctypes.c_uint32),
        # Events so far; event number n is at events[n % EVENTS].
        ("event_count", ctypes.c_uint64),
        # Recent events.
        ("events", Event * 32),
    ]


assert ctypes.sizeof(Health) == 1416
assert Health.header.offset == 0
assert Health.cycles.offset == 48
assert Health.missed.offset == 56
assert Health.over_budget.offset == 64
assert Health.slips.offset == 72
assert Health.lost.offset == 80
assert Health.late.offset == 88
assert Health.duplicate.offset == 96
assert Health.invalid.offset == 104
assert Health.rejected.offset == 112
assert Health.worst_cycle_ns.offset == 240
assert Health.worst_cycle_seq.offset == 248
assert Health.last_cycle_ns.offset == 256
assert Health.period_ns.offset == 264
assert Health.deadline_ns.offset == 272
assert Health.budget_ns.offset == 280
assert Health.accounted_ns.offset == 288
assert Health.state.offset == 304
assert Health.core_wanted.offset == 308
assert Health.core.offset == 312
assert Health.pinned.offset == 316
assert Health.policy.offset == 320
assert Health.priority.offset == 324
assert Health.memory_locked.offset == 328
assert Health.pid.offset == 332
assert Health.degraded.offset == 336
assert Health.control_result.offset == 340
assert Health.control_seq.offset == 344
assert Health.control_epoch.offset == 352
assert Health.answered_epoch.offset == 360
assert Health.answered_seq.offset == 368
assert Health.particles.offset == 376
assert Health.particles_configured.offset == 380
assert Health.event_count.offset == 384
assert Health.events.offset == 392


class Verdict(ctypes.LittleEndianStructure):
    SCHEMA = 0x91D25A43A6AC796D
    TYPE_NAME = "vigil.Verdict.v1.91d25a43a6ac796d"

    @staticmethod
    def type_name():
        return Verdict.TYPE_NAME

    _fields_ = [
        # Common header. t_capture_ns is that of the frame behind this verdict, by the publisher's own clock.
        ("header", Header),
        # Run of the frame.
        ("run_id", ctypes.c_uint64),
        # Counts decisions: rises when the action or its parameters change. From 1.
        ("decision_seq", ctypes.c_uint64),
        # How long the action is valid, ns from its arrival; 0 if it is not valid.
        ("valid_for_ns", ctypes.c_uint64),
        # Probability that something is wrong.
        ("p_fault", ctypes.c_double),
        # Probability of mode; 0 for a mode that is no node of the fault tree.
        ("p_mode", ctypes.c_double),
        # Expected size of the fault mode, in the unit of size_kind; 0 without a size.
        ("size", ctypes.c_double),
        # Standard deviation of size, in the same unit.
        ("size_sd", ctypes.c_double),
        # Speed factor to apply, 0..1.
        ("speed_scale", ctypes.c_double),
        # Curvature to command: curvature_gain * curvature + curvature_offset.
        ("curvature_gain", ctypes.c_double),
        # See curvature_gain; 1/m.
        ("curvature_offset", ctypes.c_double),
        # What the robot is to do: a RecoveryKind.
        ("kind", ctypes.c_uint32),
        # Stuck wheels that the action is about, as bits in the order of the robot's wheels.
        ("stuck_wheels", ctypes.c_uint16),
        # Wheels whose encoders are not to be trusted, as bits.
        ("broken_encoders", ctypes.c_uint16),
        # 1 while the alarm stands.
        ("alarm", ctypes.c_uint32),
        # Alarms raised so far.
        ("alarm_count", ctypes.c_uint32),
        # Why nothing is seen: a Blindness; 0 while something is.
        ("blind", ctypes.c_uint32),
        # Diagnosis with hysteresis, see FaultBelief::reported.
        ("mode", ctypes.c_uint32),
        # Bit 0: identifier lost; bit 1: detector lost.
        ("lost_stages", ctypes.c_uint32),
        # In which way the component is broken: a SizeKind.
        ("size_kind", ctypes.c_uint32),
        # Name of mode, UTF-8, zeros behind it: a node of the fault tree (ND for nominal), or UNKNOWN, MULTIPLE, BLIND.
        ("mode_name", ctypes.c_char * 32),
        # Name of the next best explanation, as mode_name.
        ("runner_up_name", ctypes.c_char * 32),
        # Name of the action in the decision model, UTF-8, zeros behind it.
        ("action_name", ctypes.c_char * 32),
        # Word for size_kind: gain, bias, stuck; zeros behind it.
        ("size_name", ctypes.c_char * 32),
    ]


assert ctypes.sizeof(Verdict) == 288
assert Verdict.header.offset == 0
assert Verdict.run_id.offset == 48
assert Verdict.decision_seq.offset == 56
assert Verdict.valid_for_ns.offset == 64
assert Verdict.p_fault.offset == 72
assert Verdict.p_mode.offset == 80
assert Verdict.size.offset == 88
assert Verdict.size_sd.offset == 96
assert Verdict.speed_scale.offset == 104
assert Verdict.curvature_gain.offset == 112
assert Verdict.curvature_offset.offset == 120
assert Verdict.kind.offset == 128
assert Verdict.stuck_wheels.offset == 132
assert Verdict.broken_encoders.offset == 134
assert Verdict.alarm.offset == 136
assert Verdict.alarm_count.offset == 140
assert Verdict.blind.offset == 144
assert Verdict.mode.offset == 148
assert Verdict.lost_stages.offset == 152
assert Verdict.size_kind.offset == 156
assert Verdict.mode_name.offset == 160
assert Verdict.runner_up_name.offset == 192
assert Verdict.action_name.offset == 224
assert Verdict.size_name.offset == 256


def _folders():
    """Where the folders of graphs lie."""
    user = os.environ.get("XDG_RUNTIME_DIR")
    folders = ["/run/vigil"] + ([f"{user}/vigil"] if user else [])
    return folders + [f"{tempfile.gettempdir()}/vigil-{os.getuid()}"]


def _is_running(folder):
    """True if a launcher or a service holds the lock of a graph: what was killed left its files."""
    import fcntl

    try:
        os.stat(f"{folder}/processes")
        with open(f"{folder}/lock") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False


def running_graphs():
    """Names of the running graphs that this user may join."""
    found = []
    for folder in _folders():
        try:
            found += [name for name in os.listdir(folder) if _is_running(f"{folder}/{name}")]
        except OSError:
            pass
    return sorted(found)


def runtime_folder(graph="rover"):
    """Folder of a running graph: its sockets and the files of its transport.

    Raises FileNotFoundError while there is none: the graph cleans up what joins before it.
    """
    closed = None
    for folder in _folders():
        try:
            os.stat(f"{folder}/{graph}/processes")
            if _is_running(f"{folder}/{graph}"):
                return f"{folder}/{graph}"
        except FileNotFoundError:
            pass
        except PermissionError:
            closed = folder
    if closed is not None:
        other = f"{closed} is another user's"
        raise PermissionError(f"no graph '{graph}' of yours is running, and {other}")
    raise FileNotFoundError(f"no graph '{graph}' is running (looked in {_folders()})")


def transport(graph="rover"):
    """Configuration of iceoryx2 (package `iceoryx2`, version 0.10) with which to join the graph."""
    import iceoryx2

    folder, start = runtime_folder(graph), ""
    try:
        # Each start of a graph has files of its own names.
        with open(f"{folder}/start") as file:
            start = file.read()
    except FileNotFoundError:
        pass
    config = iceoryx2.config.default()
    config.global_cfg.prefix = iceoryx2.FileName.new(f"vigil_{graph}_{start}")
    config.global_cfg.root_path = iceoryx2.Path.new(f"{folder}/t")
    return config


def difference(graph="rover"):
    """What is different between a running graph's types and ours: a sentence."""
    with open(f"{runtime_folder(graph)}/types") as file:
        theirs = {line.split(".")[1]: line.split() for line in file}
    here, there = importlib.metadata.version("iceoryx2"), theirs["SensorFrame"][3]
    for kind in (SensorFrame, Action):
        ours = [kind.type_name(), str(ctypes.sizeof(kind)), str(ctypes.alignment(kind))]
        if ours != theirs[kind.__name__][:3]:
            words = "{}, {} bytes, alignment {} (iceoryx2 {})"
            graphs = "the graph has " + words.format(*theirs[kind.__name__])
            program = "this program has " + words.format(*ours, here)
            return f"{graphs}; {program}: make vigil_types.py anew with 'vigil types python'"
    return f"the types are the same; the graph has iceoryx2 {there}, this program {here}"


class Channels:
    """Which place of a frame's command and channels has which name: a robot's channel list.

    Made of the text that `vigil channels --robot F` prints; Channels.read(path) makes it of a file.
    `axes` and `channels` are the places by name, `units` the units by name, `-` for none.
    """

    def __init__(self, text):
        self.robot_hash, self.axes, self.channels, self.units = 0, {}, {}, {}
        for line in text.splitlines():
            kind, number, name, *unit = line.split()
            if kind == "robot":
                self.robot_hash = int(number, 16)
            elif kind in ("command", "channel"):
                (self.axes if kind == "command" else self.channels)[name] = int(number)
                self.units[name] = " ".join(unit)
        if self.robot_hash == 0:
            raise ValueError("no channel list: it has no line 'robot HASH NAME'")

    @staticmethod
    def read(path):
        """The list of a file."""
        with open(path) as file:
            return Channels(file.read())

    def set(self, frame, name, value):
        """Writes a channel and marks it as measured; KeyError with the names that there are."""
        place = self._place(self.channels, name)
        frame.channel[place] = value
        frame.channel_valid |= 1 << place
        frame.robot_hash = self.robot_hash

    def command(self, frame, name, value):
        """Writes an axis of the command and marks it as known; KeyError as above."""
        place = self._place(self.axes, name)
        frame.command[place] = value
        frame.command_valid |= 1 << place
        frame.robot_hash = self.robot_hash

    @staticmethod
    def _place(places, name):
        if name not in places:
            raise KeyError(f"'{name}' is none of {', '.join(places)}")
        return places[name]


def channel_list(graph="rover"):
    """The Channels of a running graph."""
    return Channels.read(f"{runtime_folder(graph)}/channels")


def addresses(graph="rover"):
    """Where a running graph takes datagrams: host:port or a path. LookupError if it takes none."""
    try:
        with open(f"{runtime_folder(graph)}/addresses") as file:
            found = [line.split(None, 1)[1].strip() for line in file]
    except FileNotFoundError:
        # That there is no graph is another answer.
        runtime_folder(graph)
        found = []
    if not found:
        raise LookupError(f"graph '{graph}' takes no datagrams")
    return found


def _table():
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (0x82F63B78 if byte & 1 else 0)
        yield byte


_CRC_TABLE = tuple(_table())


def crc32c(data):
    """CRC-32C (Castagnoli)."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc = _CRC_TABLE[(crc ^ byte) & 0xFF] ^ (crc >> 8)
    return crc ^ 0xFFFFFFFF


def datagram(frame):
    """The datagram of a SensorFrame, for the sockets of `sensor.source = "socket"`.

    The sender fills in header.epoch (not 0, another at each start), header.seq and
    header.t_capture_ns; it leaves header.t_schedule_ns at 0 unless it runs on Vigil's machine.
    """
    frame.header.schema = SensorFrame.SCHEMA
    body = bytes(frame)
    head = _head(1, len(body))
    return head + struct.pack("<I", crc32c(head + body)) + body


def _head(kind, size):
    return b"VGIL" + struct.pack("<HHI", 2, kind, size)


def verdict_of(data):
    """The Verdict of a datagram that came back; None if it is none.

    A robot obeys it for valid_for_ns from its arrival, and stops after that.
    """
    head, size = _head(2, ctypes.sizeof(Verdict)), ctypes.sizeof(Verdict)
    if len(data) != 16 + size or data[:12] != head:
        return None
    if struct.unpack("<I", data[12:16])[0] != crc32c(head + data[16:]):
        return None
    verdict = Verdict.from_buffer_copy(data[16:])
    return verdict if verdict.header.schema == Verdict.SCHEMA else None
