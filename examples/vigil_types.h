/* Wire blocks of Vigil, for C11 and C++17.
 * Made by `vigil types c`; do not edit.
 *
 * Units are SI, angles radians, times CLOCK_MONOTONIC nanoseconds; x forward, y left, yaw
 * counter-clockwise. All numbers little-endian, no padding. Which place of a frame's command and
 * channels means what: the file `channels` of the running graph, or `vigil channels`. */
#ifndef VIGIL_TYPES_H
#define VIGIL_TYPES_H

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "blocks and datagrams are little-endian"
#endif

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
#define VIGIL_ASSERT(condition) static_assert(condition, #condition)
#else
#define VIGIL_ASSERT(condition) _Static_assert(condition, #condition)
#endif

#define VIGIL_SYMPTOM_EPS 1u
#define VIGIL_SYMPTOM_EPM 2u
#define VIGIL_SYMPTOM_LD 4u
#define VIGIL_SYMPTOM_SD 8u
#define VIGIL_SYMPTOM_BO 16u
#define VIGIL_SYMPTOM_ALT 32u
#define VIGIL_SYMPTOM_NNA 64u
#define VIGIL_OUTCOME_NONE 0u
#define VIGIL_OUTCOME_RUNNING 1u
#define VIGIL_OUTCOME_SUCCEEDED 2u
#define VIGIL_OUTCOME_FAILED 3u
#define VIGIL_RECOVERY_NONE 0u
#define VIGIL_RECOVERY_GO_ON 1u
#define VIGIL_RECOVERY_SLOW_DOWN 2u
#define VIGIL_RECOVERY_STOP 3u
#define VIGIL_RECOVERY_COMPENSATE 4u
#define VIGIL_RECOVERY_IGNORE_ENCODER 5u
#define VIGIL_RECOVERY_CALL_FOR_HELP 6u
#define VIGIL_RECOVERY_NEW_PATH 7u
#define VIGIL_RECOVERY_RELOCALISE 8u
#define VIGIL_RECOVERY_GO_THROUGH 9u
#define VIGIL_RECOVERY_MOVE_AWAY 10u
#define VIGIL_RECOVERY_GIVE_UP 11u
#define VIGIL_RECOVERY_OWN 12u
#define VIGIL_RECOVERY_LIMP_HOME 13u
#define VIGIL_CONTROL_POLICY 1u
#define VIGIL_CONTROL_DUAL 2u
#define VIGIL_CONTROL_FALLBACK 3u
#define VIGIL_CONTROL_SAFE 4u
#define VIGIL_SIZE_NONE 0u
#define VIGIL_SIZE_GAIN 1u
#define VIGIL_SIZE_BIAS_RAD_S 2u
#define VIGIL_SIZE_DRIFT_RAD_S2 3u
#define VIGIL_SIZE_DELAY_S 4u
#define VIGIL_SIZE_ANGLE_RAD 5u
#define VIGIL_SIZE_TORQUE_SHARE_LOST 6u
#define VIGIL_SIZE_CURRENT_OFFSET_A 7u
#define VIGIL_SIZE_RATE_BIAS_RAD_S 8u
#define VIGIL_SIZE_ZERO 9u
#define VIGIL_SIZE_FROZEN 10u
#define VIGIL_SIZE_NOISE 11u
#define VIGIL_SIZE_DEAD 12u
#define VIGIL_SIZE_STUCK 13u
#define VIGIL_SIZE_HELD_AT_RAD 14u
#define VIGIL_SIZE_JUMP_M 15u
#define VIGIL_SIZE_BIAS 16u
#define VIGIL_SIZE_DRIFT 17u
#define VIGIL_SIZE_NOISE_RATIO 18u
#define VIGIL_SIZE_MISSING 19u
#define VIGIL_SIZE_ERRATIC 20u
#define VIGIL_SIZE_EFFECT_SHARE_LOST 21u
#define VIGIL_SIZE_GRIP_SHARE_LOST 22u
#define VIGIL_SIZE_SPEED_SHARE_ADDED 23u
#define VIGIL_CAUSE_FRAME 1u
#define VIGIL_CAUSE_MISSED 2u
#define VIGIL_IDENTIFYING_CATCHING_UP 2u
#define VIGIL_DATAGRAM_SIZE 592u
#define VIGIL_VERDICT_DATAGRAM_SIZE 304u

typedef struct {
  /* Schema hash of the block (Block::SCHEMA). */
  uint64_t schema;
  /* Identity of the writer's start; differs after each restart, never 0 once written. */
  uint64_t epoch;
  /* Sequence number of the block under its epoch, from 0. */
  uint64_t seq;
  /* Instant at which the sensor cycle behind this block was due, ns, CLOCK_MONOTONIC. */
  uint64_t t_schedule_ns;
  /* Instant at which the data was captured, ns; the recording's own time in a playback. Only its differences have meaning. */
  uint64_t t_capture_ns;
  /* Instant at which the block was handed to the transport, ns, CLOCK_MONOTONIC. */
  uint64_t t_publish_ns;
} vigil_header;
VIGIL_ASSERT(sizeof(vigil_header) == 48);
VIGIL_ASSERT(offsetof(vigil_header, schema) == 0);
VIGIL_ASSERT(offsetof(vigil_header, epoch) == 8);
VIGIL_ASSERT(offsetof(vigil_header, seq) == 16);
VIGIL_ASSERT(offsetof(vigil_header, t_schedule_ns) == 24);
VIGIL_ASSERT(offsetof(vigil_header, t_capture_ns) == 32);
VIGIL_ASSERT(offsetof(vigil_header, t_publish_ns) == 40);

typedef struct {
  /* A CauseKind. */
  uint32_t kind;
  /* Frames folded into this block (1 if on time), or periods missed. */
  uint32_t count;
  /* Epoch of the newest sensor frame taken. */
  uint64_t frame_epoch;
  /* Sequence number of the newest sensor frame taken. */
  uint64_t frame_seq;
} vigil_cause;
VIGIL_ASSERT(sizeof(vigil_cause) == 24);
VIGIL_ASSERT(offsetof(vigil_cause, kind) == 0);
VIGIL_ASSERT(offsetof(vigil_cause, count) == 4);
VIGIL_ASSERT(offsetof(vigil_cause, frame_epoch) == 8);
VIGIL_ASSERT(offsetof(vigil_cause, frame_seq) == 16);

typedef struct {
  /* Bit i: node i of the tree (always a leaf) is in the set; 0 is the nominal mode. */
  uint64_t leaves;
  /* Probability that exactly this set is present. */
  double p;
} vigil_fault_set;
VIGIL_ASSERT(sizeof(vigil_fault_set) == 16);
VIGIL_ASSERT(offsetof(vigil_fault_set, leaves) == 0);
VIGIL_ASSERT(offsetof(vigil_fault_set, p) == 8);

typedef struct {
  /* Pose: x m, y m, yaw rad. */
  double pose[3];
  /* Its covariance. */
  double pose_covariance[6];
  /* What the motion departs from its model by where the robot drives, per metre: yaw rad/m, forward, lateral. While a fault is suspected: from before it. */
  double deviation[3];
  /* Its covariance. */
  double deviation_covariance[6];
  /* Direction of travel that the deviation is of: 1 forwards, -1 backwards, 0 any. */
  double direction;
  /* Share of their rates that all wheels depart by together: mean and variance. */
  double wheel_ratio[2];
  /* Rate by which each wheel departs beside that, rad/s. */
  double wheel_offset[8];
  /* Its variance. */
  double wheel_offset_variance[8];
} vigil_healthy_belief;
VIGIL_ASSERT(sizeof(vigil_healthy_belief) == 296);
VIGIL_ASSERT(offsetof(vigil_healthy_belief, pose) == 0);
VIGIL_ASSERT(offsetof(vigil_healthy_belief, pose_covariance) == 24);
VIGIL_ASSERT(offsetof(vigil_healthy_belief, deviation) == 72);
VIGIL_ASSERT(offsetof(vigil_healthy_belief, deviation_covariance) == 96);
VIGIL_ASSERT(offsetof(vigil_healthy_belief, direction) == 144);
VIGIL_ASSERT(offsetof(vigil_healthy_belief, wheel_ratio) == 152);
VIGIL_ASSERT(offsetof(vigil_healthy_belief, wheel_offset) == 168);
VIGIL_ASSERT(offsetof(vigil_healthy_belief, wheel_offset_variance) == 232);

typedef struct {
  /* Set of faults: bit i is node i of the fault tree (always a leaf); 0 is none, or unknown. */
  uint64_t leaves;
  /* Since when it holds, capture time ns; 0 for nominal, and where no alarm stands. */
  uint64_t onset_t_capture_ns;
  /* Mean pose: x m, y m, yaw rad (not wrapped). Zero where no pose is tracked. */
  double pose[3];
  /* Its covariance: upper triangle, row by row; zero for a sampled particle. */
  double pose_covariance[6];
  /* Natural logarithm of its probability. */
  double log_weight;
  /* Index into the fault tree's nodes (0 is nominal), MODE_UNKNOWN or MODE_MULTIPLE. */
  uint32_t mode;
  /* Reserved, zero. */
  uint32_t reserved;
} vigil_weighted_hypothesis;
VIGIL_ASSERT(sizeof(vigil_weighted_hypothesis) == 104);
VIGIL_ASSERT(offsetof(vigil_weighted_hypothesis, leaves) == 0);
VIGIL_ASSERT(offsetof(vigil_weighted_hypothesis, onset_t_capture_ns) == 8);
VIGIL_ASSERT(offsetof(vigil_weighted_hypothesis, pose) == 16);
VIGIL_ASSERT(offsetof(vigil_weighted_hypothesis, pose_covariance) == 40);
VIGIL_ASSERT(offsetof(vigil_weighted_hypothesis, log_weight) == 88);
VIGIL_ASSERT(offsetof(vigil_weighted_hypothesis, mode) == 96);
VIGIL_ASSERT(offsetof(vigil_weighted_hypothesis, reserved) == 100);

typedef struct {
  /* When, CLOCK_MONOTONIC ns. */
  uint64_t t_ns;
  /* An EventKind. */
  uint32_t kind;
  /* See EventKind. */
  uint32_t what;
  /* Probability, where the event has one; else as EventKind says, or 0. */
  double p;
  /* See EventKind. */
  uint64_t value;
} vigil_event;
VIGIL_ASSERT(sizeof(vigil_event) == 32);
VIGIL_ASSERT(offsetof(vigil_event, t_ns) == 0);
VIGIL_ASSERT(offsetof(vigil_event, kind) == 8);
VIGIL_ASSERT(offsetof(vigil_event, what) == 12);
VIGIL_ASSERT(offsetof(vigil_event, p) == 16);
VIGIL_ASSERT(offsetof(vigil_event, value) == 24);

typedef struct {
  /* Counts the graph's faults, from 1; 0: this place is free. */
  uint64_t number;
  /* When it was present first, ns. */
  uint64_t first_ns;
  /* When it was present last, ns. */
  uint64_t last_ns;
  /* When its state changed last, ns. */
  uint64_t changed_ns;
  /* Probability when it was present last. */
  double p;
  /* Expected size then, in the unit of size_kind; 0 without one. */
  double size;
  /* Its standard deviation. */
  double size_sd;
  /* Evidence of evidence_channel then, nat. */
  double evidence;
  /* Freeze frame: capture time of the frame nearest to the onset of the most probable fault, ns; 0 without one. */
  uint64_t frame_t_capture_ns;
  /* See SensorFrame::channel_valid, of the freeze frame. */
  uint64_t channel_valid;
  /* Its channels. */
  double channel[48];
  /* Its command. */
  double command[8];
  /* Where it lies: a FaultSource. */
  uint32_t source;
  /* Of the robot: a node of the fault tree or MODE_UNKNOWN. Of an input: a Blindness. Of a service: its index in the order of the data. */
  uint32_t what;
  /* A FaultState. */
  uint32_t state;
  /* A Severity. */
  uint32_t severity;
  /* How often it became active. */
  uint32_t count;
  /* A SizeKind. */
  uint32_t size_kind;
  /* The channel that spoke most for it; see Evidence. */
  uint32_t evidence_channel;
  /* The next best explanation: a mode, as in FaultBelief::runner_up. */
  uint32_t runner_up;
  /* What was done about it last: an action of the decision model. */
  uint32_t action;
  /* See SensorFrame::command_valid, of the freeze frame. */
  uint32_t command_valid;
  /* 1 if it stays until somebody acknowledges it. */
  uint32_t latches;
  /* Reserved, zero. */
  uint32_t reserved;
} vigil_fault_record;
VIGIL_ASSERT(sizeof(vigil_fault_record) == 576);
VIGIL_ASSERT(offsetof(vigil_fault_record, number) == 0);
VIGIL_ASSERT(offsetof(vigil_fault_record, first_ns) == 8);
VIGIL_ASSERT(offsetof(vigil_fault_record, last_ns) == 16);
VIGIL_ASSERT(offsetof(vigil_fault_record, changed_ns) == 24);
VIGIL_ASSERT(offsetof(vigil_fault_record, p) == 32);
VIGIL_ASSERT(offsetof(vigil_fault_record, size) == 40);
VIGIL_ASSERT(offsetof(vigil_fault_record, size_sd) == 48);
VIGIL_ASSERT(offsetof(vigil_fault_record, evidence) == 56);
VIGIL_ASSERT(offsetof(vigil_fault_record, frame_t_capture_ns) == 64);
VIGIL_ASSERT(offsetof(vigil_fault_record, channel_valid) == 72);
VIGIL_ASSERT(offsetof(vigil_fault_record, channel) == 80);
VIGIL_ASSERT(offsetof(vigil_fault_record, command) == 464);
VIGIL_ASSERT(offsetof(vigil_fault_record, source) == 528);
VIGIL_ASSERT(offsetof(vigil_fault_record, what) == 532);
VIGIL_ASSERT(offsetof(vigil_fault_record, state) == 536);
VIGIL_ASSERT(offsetof(vigil_fault_record, severity) == 540);
VIGIL_ASSERT(offsetof(vigil_fault_record, count) == 544);
VIGIL_ASSERT(offsetof(vigil_fault_record, size_kind) == 548);
VIGIL_ASSERT(offsetof(vigil_fault_record, evidence_channel) == 552);
VIGIL_ASSERT(offsetof(vigil_fault_record, runner_up) == 556);
VIGIL_ASSERT(offsetof(vigil_fault_record, action) == 560);
VIGIL_ASSERT(offsetof(vigil_fault_record, command_valid) == 564);
VIGIL_ASSERT(offsetof(vigil_fault_record, latches) == 568);
VIGIL_ASSERT(offsetof(vigil_fault_record, reserved) == 572);

typedef struct {
  /* The run. */
  uint64_t run_id;
  /* Capture time of the frame that raised the detector's alarm, ns; 0 while none stands. */
  uint64_t detected_t_capture_ns;
  /* The detector's probability of a fault. */
  double p_fault;
  /* See Action::alarm_t_capture_ns. */
  uint64_t alarm_t_capture_ns;
  /* Hash of the decision model. */
  uint64_t model_hash;
  /* See Action::alarm_count. */
  uint32_t alarm_count;
  /* 1 + the action of the decision model that stands until a new run, whatever is believed; 0 without one. */
  uint32_t latched;
} vigil_carryover;
VIGIL_ASSERT(sizeof(vigil_carryover) == 48);
VIGIL_ASSERT(offsetof(vigil_carryover, run_id) == 0);
VIGIL_ASSERT(offsetof(vigil_carryover, detected_t_capture_ns) == 8);
VIGIL_ASSERT(offsetof(vigil_carryover, p_fault) == 16);
VIGIL_ASSERT(offsetof(vigil_carryover, alarm_t_capture_ns) == 24);
VIGIL_ASSERT(offsetof(vigil_carryover, model_hash) == 32);
VIGIL_ASSERT(offsetof(vigil_carryover, alarm_count) == 40);
VIGIL_ASSERT(offsetof(vigil_carryover, latched) == 44);

#define VIGIL_SENSOR_FRAME_SCHEMA 0xe54ee7c97147decdull
#define VIGIL_SENSOR_FRAME_TYPE_NAME "vigil.SensorFrame.v1.e54ee7c97147decd"
typedef struct {
  /* Common header; t_schedule_ns is when this cycle was due. */
  vigil_header header;
  /* Identity of the run; a new value resets every filter. */
  uint64_t run_id;
  /* Which command and channels the numbers mean: the hash of the robot's channel list. A frame with another one is refused. */
  uint64_t robot_hash;
  /* Bit i: channel[i] holds a measurement. */
  uint64_t channel_valid;
  /* decision_seq of the last Action that the robot obeyed; 0 for none. */
  uint64_t action_seq;
  /* Outcome of that action: an ActionOutcome. */
  uint32_t action_outcome;
  /* Symptoms reported by monitors outside Vigil: bits of Symptoms. */
  uint32_t symptoms;
  /* Counts jumps of the pose's frame (relocalisation): a new value re-anchors the track. */
  uint32_t pose_reset_count;
  /* 1 while the robot holds itself stopped because it has no valid action. */
  uint32_t safe_stop;
  /* Bit i: command[i] is known. */
  uint32_t command_valid;
  /* 1 if planned_pose is known. */
  uint32_t planned_pose_valid;
  /* The command as executed; the robot's description gives its axes and units. Rover: signed curvature 1/m (left +), speed m/s. */
  double command[8];
  /* Measurements, in the order of the robot's channel list, in the units that it gives; 0 where nothing was measured. */
  double channel[48];
  /* Planned pose x m, y m, yaw rad, in the frame of the pose's channels. */
  double planned_pose[3];
} vigil_sensor_frame;
VIGIL_ASSERT(sizeof(vigil_sensor_frame) == 576);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, header) == 0);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, run_id) == 48);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, robot_hash) == 56);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, channel_valid) == 64);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, action_seq) == 72);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, action_outcome) == 80);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, symptoms) == 84);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, pose_reset_count) == 88);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, safe_stop) == 92);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, command_valid) == 96);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, planned_pose_valid) == 100);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, command) == 104);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, channel) == 168);
VIGIL_ASSERT(offsetof(vigil_sensor_frame, planned_pose) == 552);

#define VIGIL_DETECTION_BELIEF_SCHEMA 0xaa8cf898b07dabd6ull
#define VIGIL_DETECTION_BELIEF_TYPE_NAME "vigil.DetectionBelief.v1.aa8cf898b07dabd6"
typedef struct {
  /* Common header. */
  vigil_header header;
  /* The journal entry behind this belief. */
  vigil_cause cause;
  /* Run of the frame. */
  uint64_t run_id;
  /* Probability that the robot is not in its nominal mode. */
  double p_fault;
  /* Its log-odds, natural logarithm. */
  double log_odds;
  /* Log-odds at which the alarm rises (calibrated; natural logarithm). */
  double alarm_log_odds;
  /* Log-likelihood of this frame under the nominal mode, natural logarithm. */
  double evidence;
  /* Estimated ratio of the noise of the pose (x, y, yaw) to the learned one (standard deviations). */
  double noise_scale[3];
  /* The same for each wheel's rate. */
  double noise_scale_wheels[8];
  /* The same for each steering angle. */
  double noise_scale_steer[8];
  /* Estimated share of the samples of the pose (x, y, yaw) that are outliers. */
  double outlier_rate[3];
  /* The same for each wheel's rate. */
  double outlier_rate_wheels[8];
  /* The same for each steering angle. */
  double outlier_rate_steer[8];
  /* Log-odds of a fault seen by each channel alone (see Evidence). */
  double channel_log_odds[50];
  /* decision_seq of the last action that the robot obeyed, as the frame says it. */
  uint64_t action_seq;
  /* Capture time of the frame that raised the present alarm, ns; 0 without alarm. */
  uint64_t alarm_t_capture_ns;
  /* 1 while the alarm stands. */
  uint32_t alarm;
  /* Alarms raised so far. */
  uint32_t alarm_count;
  /* Symptoms: the detector's own or-ed with external ones (see Symptoms). */
  uint32_t symptoms;
  /* Frames refused by the filter because a channel was not finite or out of range. */
  uint32_t invalid_count;
  /* Steps whose weights degenerated (coasted, or re-initialised). */
  uint32_t degenerate_count;
  /* Outcome of that action, as the frame says it: an ActionOutcome. */
  uint32_t action_outcome;
  /* Why the detector sees nothing: a Blindness; 0 while it sees. */
  uint32_t blind;
  /* Whether an alarm could rise now: a Readiness. */
  uint32_t readiness;
  /* When the last change came that is no fault, capture time, ns; 0 before the first one. */
  uint64_t context_t_capture_ns;
  /* Such changes told so far. */
  uint32_t context_count;
  /* Which of the description's contexts the last one was, from 0. */
  uint32_t context;
} vigil_detection_belief;
VIGIL_ASSERT(sizeof(vigil_detection_belief) == 880);
VIGIL_ASSERT(offsetof(vigil_detection_belief, header) == 0);
VIGIL_ASSERT(offsetof(vigil_detection_belief, cause) == 48);
VIGIL_ASSERT(offsetof(vigil_detection_belief, run_id) == 72);
VIGIL_ASSERT(offsetof(vigil_detection_belief, p_fault) == 80);
VIGIL_ASSERT(offsetof(vigil_detection_belief, log_odds) == 88);
VIGIL_ASSERT(offsetof(vigil_detection_belief, alarm_log_odds) == 96);
VIGIL_ASSERT(offsetof(vigil_detection_belief, evidence) == 104);
VIGIL_ASSERT(offsetof(vigil_detection_belief, noise_scale) == 112);
VIGIL_ASSERT(offsetof(vigil_detection_belief, noise_scale_wheels) == 136);
VIGIL_ASSERT(offsetof(vigil_detection_belief, noise_scale_steer) == 200);
VIGIL_ASSERT(offsetof(vigil_detection_belief, outlier_rate) == 264);
VIGIL_ASSERT(offsetof(vigil_detection_belief, outlier_rate_wheels) == 288);
VIGIL_ASSERT(offsetof(vigil_detection_belief, outlier_rate_steer) == 352);
VIGIL_ASSERT(offsetof(vigil_detection_belief, channel_log_odds) == 416);
VIGIL_ASSERT(offsetof(vigil_detection_belief, action_seq) == 816);
VIGIL_ASSERT(offsetof(vigil_detection_belief, alarm_t_capture_ns) == 824);
VIGIL_ASSERT(offsetof(vigil_detection_belief, alarm) == 832);
VIGIL_ASSERT(offsetof(vigil_detection_belief, alarm_count) == 836);
VIGIL_ASSERT(offsetof(vigil_detection_belief, symptoms) == 840);
VIGIL_ASSERT(offsetof(vigil_detection_belief, invalid_count) == 844);
VIGIL_ASSERT(offsetof(vigil_detection_belief, degenerate_count) == 848);
VIGIL_ASSERT(offsetof(vigil_detection_belief, action_outcome) == 852);
VIGIL_ASSERT(offsetof(vigil_detection_belief, blind) == 856);
VIGIL_ASSERT(offsetof(vigil_detection_belief, readiness) == 860);
VIGIL_ASSERT(offsetof(vigil_detection_belief, context_t_capture_ns) == 864);
VIGIL_ASSERT(offsetof(vigil_detection_belief, context_count) == 872);
VIGIL_ASSERT(offsetof(vigil_detection_belief, context) == 876);

#define VIGIL_PARTICLE_BLOCK_SCHEMA 0x60e41525a1aef4b2ull
#define VIGIL_PARTICLE_BLOCK_TYPE_NAME "vigil.ParticleBlock.v1.60e41525a1aef4b2"
typedef struct {
  /* Common header. */
  vigil_header header;
  /* The journal entry behind these hypotheses. */
  vigil_cause cause;
  /* Hypotheses in use; the rest of the array is unspecified. */
  uint32_t count;
  /* Reserved, zero. */
  uint32_t reserved;
  /* What an identification starts from; zero while one is under way. */
  vigil_healthy_belief healthy;
  /* The hypotheses. */
  vigil_weighted_hypothesis hypotheses[1024];
} vigil_particle_block;
VIGIL_ASSERT(sizeof(vigil_particle_block) == 106872);
VIGIL_ASSERT(offsetof(vigil_particle_block, header) == 0);
VIGIL_ASSERT(offsetof(vigil_particle_block, cause) == 48);
VIGIL_ASSERT(offsetof(vigil_particle_block, count) == 72);
VIGIL_ASSERT(offsetof(vigil_particle_block, reserved) == 76);
VIGIL_ASSERT(offsetof(vigil_particle_block, healthy) == 80);
VIGIL_ASSERT(offsetof(vigil_particle_block, hypotheses) == 376);

#define VIGIL_FAULT_BELIEF_SCHEMA 0x43a94bf286deb000ull
#define VIGIL_FAULT_BELIEF_TYPE_NAME "vigil.FaultBelief.v1.43a94bf286deb000"
typedef struct {
  /* Common header. */
  vigil_header header;
  /* The journal entry behind this belief. */
  vigil_cause cause;
  /* Run of the frame. */
  uint64_t run_id;
  /* Hash of the fault tree that gives the nodes their meaning. */
  uint64_t tree_hash;
  /* Probability of each node: that a leaf's fault is present, alone or with others; that any fault below an abstract node is. Node 0 is nominal: no fault at all. */
  double p[64];
  /* The same before this cycle's data: prediction from the last cycle. */
  double p_predicted[64];
  /* Probability that no modelled fault explains the data. */
  double p_unknown;
  /* The same before this cycle's data. */
  double p_unknown_predicted;
  /* Most probable sets of leaves, in falling order. */
  vigil_fault_set sets[8];
  /* Entropy of the distribution over sets and unknown, nats. */
  double entropy;
  /* Why this diagnosis and not the next best one: by channel, how much more the readings since the onset are expected under it than under runner_up, natural log-likelihood; see Evidence. 0 while nothing is diagnosed. */
  double channel_evidence[50];
  /* Expected size of each node's fault, given that it is present, in the unit of its size_kind; 0 without a size. */
  double size[64];
  /* Standard deviation of size, in the same unit. */
  double size_sd[64];
  /* Probability of mode. */
  double p_mode;
  /* Capture time of the frame that raised the alarm, ns; 0 before an alarm. */
  uint64_t alarm_t_capture_ns;
  /* Most probable onset of the most probable fault, capture time ns; 0 if none. */
  uint64_t onset_t_capture_ns;
  /* Mode, memoryless: a node's index, MODE_UNKNOWN, MODE_MULTIPLE or MODE_BLIND. */
  uint32_t mode;
  /* Reported mode: follows mode with hysteresis. */
  uint32_t reported;
  /* Changes of reported so far. */
  uint32_t reported_change_count;
  /* The next best explanation that is not the best and one more fault: a node's index (0 is nominal), MODE_UNKNOWN or MODE_MULTIPLE. */
  uint32_t runner_up;
  /* Particles or hypotheses allowed at present; fewer than configured while time is short. */
  uint32_t particle_limit;
  /* Changes of mode so far. */
  uint32_t mode_change_count;
  /* Nodes in use. */
  uint32_t node_count;
  /* Sets in use. */
  uint32_t set_count;
  /* 1 while identifying (an alarm stands or a fault is believed), CATCHING_UP before the first result of that; 0 while watching, or while nothing is known yet of an alarm that stood before the identifier began. */
  uint32_t identifying;
  /* Steps that met impossible or non-finite evidence and kept the prediction. */
  uint32_t degenerate_count;
  /* In which way each node's component is most probably broken, given that it is: a SizeKind, which gives size its unit. */
  uint32_t size_kind[64];
} vigil_fault_belief;
VIGIL_ASSERT(sizeof(vigil_fault_belief) == 3008);
VIGIL_ASSERT(offsetof(vigil_fault_belief, header) == 0);
VIGIL_ASSERT(offsetof(vigil_fault_belief, cause) == 48);
VIGIL_ASSERT(offsetof(vigil_fault_belief, run_id) == 72);
VIGIL_ASSERT(offsetof(vigil_fault_belief, tree_hash) == 80);
VIGIL_ASSERT(offsetof(vigil_fault_belief, p) == 88);
VIGIL_ASSERT(offsetof(vigil_fault_belief, p_predicted) == 600);
VIGIL_ASSERT(offsetof(vigil_fault_belief, p_unknown) == 1112);
VIGIL_ASSERT(offsetof(vigil_fault_belief, p_unknown_predicted) == 1120);
VIGIL_ASSERT(offsetof(vigil_fault_belief, sets) == 1128);
VIGIL_ASSERT(offsetof(vigil_fault_belief, entropy) == 1256);
VIGIL_ASSERT(offsetof(vigil_fault_belief, channel_evidence) == 1264);
VIGIL_ASSERT(offsetof(vigil_fault_belief, size) == 1664);
VIGIL_ASSERT(offsetof(vigil_fault_belief, size_sd) == 2176);
VIGIL_ASSERT(offsetof(vigil_fault_belief, p_mode) == 2688);
VIGIL_ASSERT(offsetof(vigil_fault_belief, alarm_t_capture_ns) == 2696);
VIGIL_ASSERT(offsetof(vigil_fault_belief, onset_t_capture_ns) == 2704);
VIGIL_ASSERT(offsetof(vigil_fault_belief, mode) == 2712);
VIGIL_ASSERT(offsetof(vigil_fault_belief, reported) == 2716);
VIGIL_ASSERT(offsetof(vigil_fault_belief, reported_change_count) == 2720);
VIGIL_ASSERT(offsetof(vigil_fault_belief, runner_up) == 2724);
VIGIL_ASSERT(offsetof(vigil_fault_belief, particle_limit) == 2728);
VIGIL_ASSERT(offsetof(vigil_fault_belief, mode_change_count) == 2732);
VIGIL_ASSERT(offsetof(vigil_fault_belief, node_count) == 2736);
VIGIL_ASSERT(offsetof(vigil_fault_belief, set_count) == 2740);
VIGIL_ASSERT(offsetof(vigil_fault_belief, identifying) == 2744);
VIGIL_ASSERT(offsetof(vigil_fault_belief, degenerate_count) == 2748);
VIGIL_ASSERT(offsetof(vigil_fault_belief, size_kind) == 2752);

#define VIGIL_ACTION_SCHEMA 0x07b60509a93bc403ull
#define VIGIL_ACTION_TYPE_NAME "vigil.Action.v1.07b60509a93bc403"
typedef struct {
  /* Common header. */
  vigil_header header;
  /* The journal entry behind this decision. */
  vigil_cause cause;
  /* Run of the frame. */
  uint64_t run_id;
  /* Counts decisions: rises when action or its parameters change. From 1. */
  uint64_t decision_seq;
  /* CLOCK_MONOTONIC ns after which the robot must no longer obey this block, but stop. */
  uint64_t valid_until_ns;
  /* Hash of the decision model that gives states and actions their meaning. */
  uint64_t model_hash;
  /* Belief over the decision model's states. */
  double belief[64];
  /* What the policy thinks of each action, the larger the better; value_kind says what it is. Finite. */
  double value[32];
  /* Entropy of the belief, normalised to 0..1. */
  double entropy;
  /* Entropy of the states' votes for their best actions, normalised to 0..1: doubt about what to do. */
  double action_entropy;
  /* Value of the chosen action minus the runner-up's. */
  double margin;
  /* How well the last evidence was predicted: with symptoms the natural logarithm of its probability; with faults the mean of that of the predicted belief, over the belief. */
  double log_evidence;
  /* Speed factor to apply, 0..1. */
  double speed_scale;
  /* Curvature to command: curvature_gain * curvature + curvature_offset. */
  double curvature_gain;
  /* See curvature_gain; 1/m. */
  double curvature_offset;
  /* Index of the chosen action in the decision model. */
  uint32_t action;
  /* What the robot is to do: a RecoveryKind. */
  uint32_t kind;
  /* Stuck wheels that the action is about, as bits in the order of the robot's wheels. */
  uint16_t stuck_wheels;
  /* Wheels whose encoders are not to be trusted, as bits. */
  uint16_t broken_encoders;
  /* How the action was chosen: a ControlMode. */
  uint32_t control_mode;
  /* States in use. */
  uint32_t state_count;
  /* Actions in use. */
  uint32_t action_count;
  /* Observations that were impossible under the belief so far. */
  uint32_t impossible_count;
  /* Bit 0: identifier lost; bit 1: detector lost. */
  uint32_t lost_stages;
  /* What value is: a ValueKind. */
  uint32_t value_kind;
  /* 1 while the alarm stands: the detector's, unless the identifier has found the robot nominal since. */
  uint32_t alarm;
  /* Capture time of the frame that raised it, ns; 0 without alarm. */
  uint64_t alarm_t_capture_ns;
  /* Alarms raised so far. */
  uint32_t alarm_count;
  /* Why nothing is seen: a Blindness; 0 while something is. */
  uint32_t blind;
  /* Which belief the model's last step was of: how many had begun anew before, at a reset or at a new run that was not the success of an action. */
  uint64_t step_belief;
  /* Steps of the decision model so far, with symptoms; 0 with faults, whose evidence is no observation of the model. */
  uint64_t step_count;
  /* Action of the model's last step. */
  uint32_t step_action;
  /* Observation of the model's last step; u32::MAX for a set of symptoms that the model does not have. */
  uint32_t step_observation;
} vigil_action;
VIGIL_ASSERT(sizeof(vigil_action) == 1008);
VIGIL_ASSERT(offsetof(vigil_action, header) == 0);
VIGIL_ASSERT(offsetof(vigil_action, cause) == 48);
VIGIL_ASSERT(offsetof(vigil_action, run_id) == 72);
VIGIL_ASSERT(offsetof(vigil_action, decision_seq) == 80);
VIGIL_ASSERT(offsetof(vigil_action, valid_until_ns) == 88);
VIGIL_ASSERT(offsetof(vigil_action, model_hash) == 96);
VIGIL_ASSERT(offsetof(vigil_action, belief) == 104);
VIGIL_ASSERT(offsetof(vigil_action, value) == 616);
VIGIL_ASSERT(offsetof(vigil_action, entropy) == 872);
VIGIL_ASSERT(offsetof(vigil_action, action_entropy) == 880);
VIGIL_ASSERT(offsetof(vigil_action, margin) == 888);
VIGIL_ASSERT(offsetof(vigil_action, log_evidence) == 896);
VIGIL_ASSERT(offsetof(vigil_action, speed_scale) == 904);
VIGIL_ASSERT(offsetof(vigil_action, curvature_gain) == 912);
VIGIL_ASSERT(offsetof(vigil_action, curvature_offset) == 920);
VIGIL_ASSERT(offsetof(vigil_action, action) == 928);
VIGIL_ASSERT(offsetof(vigil_action, kind) == 932);
VIGIL_ASSERT(offsetof(vigil_action, stuck_wheels) == 936);
VIGIL_ASSERT(offsetof(vigil_action, broken_encoders) == 938);
VIGIL_ASSERT(offsetof(vigil_action, control_mode) == 940);
VIGIL_ASSERT(offsetof(vigil_action, state_count) == 944);
VIGIL_ASSERT(offsetof(vigil_action, action_count) == 948);
VIGIL_ASSERT(offsetof(vigil_action, impossible_count) == 952);
VIGIL_ASSERT(offsetof(vigil_action, lost_stages) == 956);
VIGIL_ASSERT(offsetof(vigil_action, value_kind) == 960);
VIGIL_ASSERT(offsetof(vigil_action, alarm) == 964);
VIGIL_ASSERT(offsetof(vigil_action, alarm_t_capture_ns) == 968);
VIGIL_ASSERT(offsetof(vigil_action, alarm_count) == 976);
VIGIL_ASSERT(offsetof(vigil_action, blind) == 980);
VIGIL_ASSERT(offsetof(vigil_action, step_belief) == 984);
VIGIL_ASSERT(offsetof(vigil_action, step_count) == 992);
VIGIL_ASSERT(offsetof(vigil_action, step_action) == 1000);
VIGIL_ASSERT(offsetof(vigil_action, step_observation) == 1004);

#define VIGIL_TRUTH_SCHEMA 0x31e8fd77ede8c9adull
#define VIGIL_TRUTH_TYPE_NAME "vigil.Truth.v1.31e8fd77ede8c9ad"
typedef struct {
  /* Common header. */
  vigil_header header;
  /* The frame of this instant. */
  vigil_cause cause;
  /* Run of that frame. */
  uint64_t run_id;
  /* Pose in the world: x m, y m, yaw rad (not wrapped). */
  double pose[3];
  /* Velocity of the body: forward m/s, lateral m/s, yaw rad/s. */
  double velocity[3];
  /* What was obeyed since the frame before: a RecoveryKind; 0 if no action was valid. */
  uint32_t obeyed;
  /* See Action::stuck_wheels, of the obeyed action. */
  uint16_t stuck_wheels;
  /* See Action::broken_encoders, of the obeyed action. */
  uint16_t broken_encoders;
  /* 1 while a fault or disturbance is in force. */
  uint32_t is_disturbed;
  /* 1 while something is within the bumper's reach. */
  uint32_t touches;
  /* 1 once the navigation holds its goal for reached. */
  uint32_t at_goal;
  /* Reserved, zero. */
  uint32_t reserved;
} vigil_truth;
VIGIL_ASSERT(sizeof(vigil_truth) == 152);
VIGIL_ASSERT(offsetof(vigil_truth, header) == 0);
VIGIL_ASSERT(offsetof(vigil_truth, cause) == 48);
VIGIL_ASSERT(offsetof(vigil_truth, run_id) == 72);
VIGIL_ASSERT(offsetof(vigil_truth, pose) == 80);
VIGIL_ASSERT(offsetof(vigil_truth, velocity) == 104);
VIGIL_ASSERT(offsetof(vigil_truth, obeyed) == 128);
VIGIL_ASSERT(offsetof(vigil_truth, stuck_wheels) == 132);
VIGIL_ASSERT(offsetof(vigil_truth, broken_encoders) == 134);
VIGIL_ASSERT(offsetof(vigil_truth, is_disturbed) == 136);
VIGIL_ASSERT(offsetof(vigil_truth, touches) == 140);
VIGIL_ASSERT(offsetof(vigil_truth, at_goal) == 144);
VIGIL_ASSERT(offsetof(vigil_truth, reserved) == 148);

#define VIGIL_FAULTS_SCHEMA 0x1c29bb227971e917ull
#define VIGIL_FAULTS_TYPE_NAME "vigil.Faults.v1.1c29bb227971e917"
typedef struct {
  /* Common header. */
  vigil_header header;
  /* Hash of the fault tree that gives the nodes their names. */
  uint64_t tree_hash;
  /* Rises with each change of a fault or of the overall state. */
  uint64_t revision;
  /* Faults so far, kept or not. */
  uint64_t fault_count;
  /* What is present and has no place. */
  uint32_t dropped_count;
  /* The overall state: an OverallState. */
  uint32_t overall;
  /* What the next supervisor goes on from. */
  vigil_carryover carryover;
  /* The faults, in no order. */
  vigil_fault_record records[16];
} vigil_faults;
VIGIL_ASSERT(sizeof(vigil_faults) == 9344);
VIGIL_ASSERT(offsetof(vigil_faults, header) == 0);
VIGIL_ASSERT(offsetof(vigil_faults, tree_hash) == 48);
VIGIL_ASSERT(offsetof(vigil_faults, revision) == 56);
VIGIL_ASSERT(offsetof(vigil_faults, fault_count) == 64);
VIGIL_ASSERT(offsetof(vigil_faults, dropped_count) == 72);
VIGIL_ASSERT(offsetof(vigil_faults, overall) == 76);
VIGIL_ASSERT(offsetof(vigil_faults, carryover) == 80);
VIGIL_ASSERT(offsetof(vigil_faults, records) == 128);

#define VIGIL_HEALTH_SCHEMA 0x22ca8e52d533df67ull
#define VIGIL_HEALTH_TYPE_NAME "vigil.Health.v1.22ca8e52d533df67"
typedef struct {
  /* Common header. */
  vigil_header header;
  /* Cycles done: blocks published, or frames for the source. */
  uint64_t cycles;
  /* Scheduled cycles whose deadline passed before the block was out. */
  uint64_t missed;
  /* Cycles whose time from wake-up to publication exceeded the budget. */
  uint64_t over_budget;
  /* Schedule instants that the source slept through. */
  uint64_t slips;
  /* Input blocks that never arrived, by gaps of their sequence numbers. */
  uint64_t lost;
  /* Input blocks that arrived after their deadline. */
  uint64_t late;
  /* Input blocks that arrived twice. */
  uint64_t duplicate;
  /* Input blocks refused: wrong schema, impossible time stamps, non-finite data. */
  uint64_t invalid;
  /* The refused ones by cause, see Rejection. */
  uint64_t rejected[16];
  /* Longest time from wake-up to publication, ns. */
  uint64_t worst_cycle_ns;
  /* Sequence number of that cycle. */
  uint64_t worst_cycle_seq;
  /* Last time from wake-up to publication, ns. */
  uint64_t last_cycle_ns;
  /* Period of the schedule, ns. */
  uint64_t period_ns;
  /* Deadline after the schedule, ns. */
  uint64_t deadline_ns;
  /* Budget of one cycle, from wake-up to publication, ns. */
  uint64_t budget_ns;
  /* Schedule instant of the service's first and last accounted cycle, ns. */
  uint64_t accounted_ns[2];
  /* A ServiceState. */
  uint32_t state;
  /* Core that was asked for. */
  uint32_t core_wanted;
  /* Core that the kernel reported in the last check. */
  uint32_t core;
  /* 1 if the kernel lets the service run on no other core than core_wanted. */
  uint32_t pinned;
  /* Scheduling policy read back (SCHED_FIFO is 1, SCHED_OTHER 0). */
  uint32_t policy;
  /* Priority read back. */
  uint32_t priority;
  /* 1 if all memory is locked. */
  uint32_t memory_locked;
  /* Process id. */
  uint32_t pid;
  /* Why the service is in degraded mode, bits of Degraded; 0 if it is not. */
  uint32_t degraded;
  /* Result of the last control command: 1 done, 2 refused, 0 none yet. */
  uint32_t control_result;
  /* Sequence number of the last control command handled. */
  uint64_t control_seq;
  /* Epoch of the writer of that command. */
  uint64_t control_epoch;
  /* Writer and sequence number of the newest sensor frame that an output has answered. */
  uint64_t answered_epoch;
  /* See answered_epoch. */
  uint64_t answered_seq;
  /* Hypotheses or particles that the time allows at present; 0 without any to shed. */
  uint32_t particles;
  /* Hypotheses or particles configured. */
  uint32_t particles_configured;
  /* Events so far; event number n is at events[n % EVENTS]. */
  uint64_t event_count;
  /* Recent events. */
  vigil_event events[32];
} vigil_health;
VIGIL_ASSERT(sizeof(vigil_health) == 1416);
VIGIL_ASSERT(offsetof(vigil_health, header) == 0);
VIGIL_ASSERT(offsetof(vigil_health, cycles) == 48);
VIGIL_ASSERT(offsetof(vigil_health, missed) == 56);
VIGIL_ASSERT(offsetof(vigil_health, over_budget) == 64);
VIGIL_ASSERT(offsetof(vigil_health, slips) == 72);
VIGIL_ASSERT(offsetof(vigil_health, lost) == 80);
VIGIL_ASSERT(offsetof(vigil_health, late) == 88);
VIGIL_ASSERT(offsetof(vigil_health, duplicate) == 96);
VIGIL_ASSERT(offsetof(vigil_health, invalid) == 104);
VIGIL_ASSERT(offsetof(vigil_health, rejected) == 112);
VIGIL_ASSERT(offsetof(vigil_health, worst_cycle_ns) == 240);
VIGIL_ASSERT(offsetof(vigil_health, worst_cycle_seq) == 248);
VIGIL_ASSERT(offsetof(vigil_health, last_cycle_ns) == 256);
VIGIL_ASSERT(offsetof(vigil_health, period_ns) == 264);
VIGIL_ASSERT(offsetof(vigil_health, deadline_ns) == 272);
VIGIL_ASSERT(offsetof(vigil_health, budget_ns) == 280);
VIGIL_ASSERT(offsetof(vigil_health, accounted_ns) == 288);
VIGIL_ASSERT(offsetof(vigil_health, state) == 304);
VIGIL_ASSERT(offsetof(vigil_health, core_wanted) == 308);
VIGIL_ASSERT(offsetof(vigil_health, core) == 312);
VIGIL_ASSERT(offsetof(vigil_health, pinned) == 316);
VIGIL_ASSERT(offsetof(vigil_health, policy) == 320);
VIGIL_ASSERT(offsetof(vigil_health, priority) == 324);
VIGIL_ASSERT(offsetof(vigil_health, memory_locked) == 328);
VIGIL_ASSERT(offsetof(vigil_health, pid) == 332);
VIGIL_ASSERT(offsetof(vigil_health, degraded) == 336);
VIGIL_ASSERT(offsetof(vigil_health, control_result) == 340);
VIGIL_ASSERT(offsetof(vigil_health, control_seq) == 344);
VIGIL_ASSERT(offsetof(vigil_health, control_epoch) == 352);
VIGIL_ASSERT(offsetof(vigil_health, answered_epoch) == 360);
VIGIL_ASSERT(offsetof(vigil_health, answered_seq) == 368);
VIGIL_ASSERT(offsetof(vigil_health, particles) == 376);
VIGIL_ASSERT(offsetof(vigil_health, particles_configured) == 380);
VIGIL_ASSERT(offsetof(vigil_health, event_count) == 384);
VIGIL_ASSERT(offsetof(vigil_health, events) == 392);

#define VIGIL_VERDICT_SCHEMA 0x91d25a43a6ac796dull
#define VIGIL_VERDICT_TYPE_NAME "vigil.Verdict.v1.91d25a43a6ac796d"
typedef struct {
  /* Common header. t_capture_ns is that of the frame behind this verdict, by the publisher's own clock. */
  vigil_header header;
  /* Run of the frame. */
  uint64_t run_id;
  /* Counts decisions: rises when the action or its parameters change. From 1. */
  uint64_t decision_seq;
  /* How long the action is valid, ns from its arrival; 0 if it is not valid. */
  uint64_t valid_for_ns;
  /* Probability that something is wrong. */
  double p_fault;
  /* Probability of mode; 0 for a mode that is no node of the fault tree. */
  double p_mode;
  /* Expected size of the fault mode, in the unit of size_kind; 0 without a size. */
  double size;
  /* Standard deviation of size, in the same unit. */
  double size_sd;
  /* Speed factor to apply, 0..1. */
  double speed_scale;
  /* Curvature to command: curvature_gain * curvature + curvature_offset. */
  double curvature_gain;
  /* See curvature_gain; 1/m. */
  double curvature_offset;
  /* What the robot is to do: a RecoveryKind. */
  uint32_t kind;
  /* Stuck wheels that the action is about, as bits in the order of the robot's wheels. */
  uint16_t stuck_wheels;
  /* Wheels whose encoders are not to be trusted, as bits. */
  uint16_t broken_encoders;
  /* 1 while the alarm stands. */
  uint32_t alarm;
  /* Alarms raised so far. */
  uint32_t alarm_count;
  /* Why nothing is seen: a Blindness; 0 while something is. */
  uint32_t blind;
  /* Diagnosis with hysteresis, see FaultBelief::reported. */
  uint32_t mode;
  /* Bit 0: identifier lost; bit 1: detector lost. */
  uint32_t lost_stages;
  /* In which way the component is broken: a SizeKind. */
  uint32_t size_kind;
  /* Name of mode, UTF-8, zeros behind it: a node of the fault tree (ND for nominal), or UNKNOWN, MULTIPLE, BLIND. */
  char mode_name[32];
  /* Name of the next best explanation, as mode_name. */
  char runner_up_name[32];
  /* Name of the action in the decision model, UTF-8, zeros behind it. */
  char action_name[32];
  /* Word for size_kind: gain, bias, stuck; zeros behind it. */
  char size_name[32];
} vigil_verdict;
VIGIL_ASSERT(sizeof(vigil_verdict) == 288);
VIGIL_ASSERT(offsetof(vigil_verdict, header) == 0);
VIGIL_ASSERT(offsetof(vigil_verdict, run_id) == 48);
VIGIL_ASSERT(offsetof(vigil_verdict, decision_seq) == 56);
VIGIL_ASSERT(offsetof(vigil_verdict, valid_for_ns) == 64);
VIGIL_ASSERT(offsetof(vigil_verdict, p_fault) == 72);
VIGIL_ASSERT(offsetof(vigil_verdict, p_mode) == 80);
VIGIL_ASSERT(offsetof(vigil_verdict, size) == 88);
VIGIL_ASSERT(offsetof(vigil_verdict, size_sd) == 96);
VIGIL_ASSERT(offsetof(vigil_verdict, speed_scale) == 104);
VIGIL_ASSERT(offsetof(vigil_verdict, curvature_gain) == 112);
VIGIL_ASSERT(offsetof(vigil_verdict, curvature_offset) == 120);
VIGIL_ASSERT(offsetof(vigil_verdict, kind) == 128);
VIGIL_ASSERT(offsetof(vigil_verdict, stuck_wheels) == 132);
VIGIL_ASSERT(offsetof(vigil_verdict, broken_encoders) == 134);
VIGIL_ASSERT(offsetof(vigil_verdict, alarm) == 136);
VIGIL_ASSERT(offsetof(vigil_verdict, alarm_count) == 140);
VIGIL_ASSERT(offsetof(vigil_verdict, blind) == 144);
VIGIL_ASSERT(offsetof(vigil_verdict, mode) == 148);
VIGIL_ASSERT(offsetof(vigil_verdict, lost_stages) == 152);
VIGIL_ASSERT(offsetof(vigil_verdict, size_kind) == 156);
VIGIL_ASSERT(offsetof(vigil_verdict, mode_name) == 160);
VIGIL_ASSERT(offsetof(vigil_verdict, runner_up_name) == 192);
VIGIL_ASSERT(offsetof(vigil_verdict, action_name) == 224);
VIGIL_ASSERT(offsetof(vigil_verdict, size_name) == 256);


/* CRC-32C (Castagnoli), bit by bit: `crc` is what came before, 0 to begin. */
static inline uint32_t vigil_crc32c(uint32_t crc, const uint8_t *bytes, size_t count) {
  crc = ~crc;
  for (size_t i = 0; i < count; i++) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; bit++) crc = (crc >> 1) ^ (0x82f63b78u & (0u - (crc & 1u)));
  }
  return ~crc;
}

/* What a datagram begins with: `kind` 1 is a frame, 2 a verdict. */
static inline void vigil_datagram_head(uint8_t kind, size_t size, uint8_t head[12]) {
  const uint8_t bytes[12] = {'V', 'G', 'I', 'L', 2, 0, kind, 0,
                             (uint8_t)(size & 0xff), (uint8_t)(size >> 8), 0, 0};
  memcpy(head, bytes, 12);
}

/* Checksum of a datagram, which holds a block of this size. */
static inline uint32_t vigil_datagram_crc(const uint8_t *bytes, size_t size) {
  return vigil_crc32c(vigil_crc32c(0, bytes, 12), bytes + 16, size);
}

/* The datagram of a frame, for the sockets of `sensor.source = "socket"`. The sender fills in
 * header.epoch (not 0, another at each start), header.seq and header.t_capture_ns; it leaves
 * header.t_schedule_ns at 0 unless it runs on Vigil's machine and has its CLOCK_MONOTONIC. */
static inline void vigil_datagram(const vigil_sensor_frame *frame,
                                  uint8_t bytes[VIGIL_DATAGRAM_SIZE]) {
  vigil_datagram_head(1, sizeof *frame, bytes);
  memcpy(bytes + 16, frame, sizeof *frame);
  const uint64_t schema = VIGIL_SENSOR_FRAME_SCHEMA;
  memcpy(bytes + 16, &schema, 8);
  const uint32_t crc = vigil_datagram_crc(bytes, sizeof *frame);
  for (int i = 0; i < 4; i++) bytes[12 + i] = (uint8_t)(crc >> (8 * i));
}

/* Takes the verdict of a datagram that came back; 0 if it is none. Obey it for
 * verdict->valid_for_ns from now, and stop after that. */
static inline int vigil_take_verdict(const uint8_t *bytes, size_t count, vigil_verdict *verdict) {
  uint8_t head[12];
  vigil_datagram_head(2, sizeof *verdict, head);
  if (count != VIGIL_VERDICT_DATAGRAM_SIZE || memcmp(bytes, head, 12) != 0) return 0;
  const uint32_t crc = vigil_datagram_crc(bytes, sizeof *verdict);
  for (int i = 0; i < 4; i++)
    if (bytes[12 + i] != (uint8_t)(crc >> (8 * i))) return 0;
  uint64_t schema = 0;
  memcpy(&schema, bytes + 16, 8);
  if (schema != VIGIL_VERDICT_SCHEMA) return 0;
  memcpy(verdict, bytes + 16, sizeof *verdict);
  return 1;
}

#endif
