//! The body follows the command with a first-order lag that depends on robot, load and ground: it
//! is learned from changes of the command, on the way.
//!
//! A bank of candidate time constants predicts travel and heading; each is weighed by how well its
//! prediction fits the measured pose. While the command is constant all predict the same, so that
//! nothing is learned and no lasting fault can pass for a lag. What the candidates disagree about
//! is the uncertainty of the prediction.

use vigil_checkpoint::CheckpointValue;

/// Candidate time constants, s: the range that is tolerated in a healthy robot.
const LAGS_S: [f64; LAGS] = [0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5];
/// Number of candidates.
const LAGS: usize = 7;
/// No candidate becomes less probable than this: a load may change. It comes back from it in four
/// windows: 3 nats each, ln 1e4 = 9.2.
const P_MIN: f64 = 1e-4;
/// Observations whose displacements are compared as one: over a single one the noise of the pose
/// hides what a lag does, and more of them are as likely to hold a change of the ground. One second
/// of 50 ms: twice the longest lag.
const WINDOW: u32 = 20;
/// One window changes the odds of two candidates by this much at most, nat: it may hold an outlier.
/// e^3 = 20 leaves a rival of even odds a twentieth.
const GAIN_MAX: f64 = 3.0;
/// How far a displacement per metre changes with the command beyond its model, m/m and rad/m: in
/// health, and while a fault is suspected: half of the rover's tolerance, and three times as much.
/// Chosen. No lag is learned from that.
const SLIP_SD: [f64; 2] = [0.03, 0.1];
/// Part of a window's slip that enters the running estimate of it, where the measurement shows it
/// well. Chosen: followed within three windows, 3 s.
const SLIP_SHARE: f64 = 0.3;
/// Time for which an error of the prediction counts as one with those before, s: about as long as a
/// change of the command and its correction by the pose take. Six of the longest lags.
const COHERENT_S: f64 = 3.0;
/// Factor on the growth of its variance: a filter takes it for white noise and averages it, which
/// an error of one sign does not do. Errors of one sign over n observations add up to n times the
/// variance. Chosen, three: smaller takes a lag that is not yet known for a departure; larger hides
/// a departure that begins while the command changes.
const COHERENCE: f64 = 3.0;

/// Commanded motion between two observations, from middle to middle, as the body follows it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FollowedMotion {
    /// Travel, m.
    pub travel_m: f64,
    /// Change of heading by the commanded curvature, rad.
    pub turn_rad: f64,
    /// Speed at the end, m/s.
    pub speed_m_s: f64,
    /// Variance of the travel by what is not known of the lag and of the command between frames,
    /// m².
    pub travel_variance: f64,
    /// The same of the change of heading, rad².
    pub turn_variance: f64,
}

/// One candidate.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct Candidate {
    /// Yaw rate rad/s and speed m/s of the body.
    body: [f64; 2],
    /// Travel m and heading rad since the last observation's middle.
    sums: [f64; 2],
    /// Mean of `sums` over the frames of the observation under way, times their number.
    middles: [f64; 2],
    /// Travel and turn from middle to middle, of the observation that was completed last.
    moved: [f64; 2],
    /// The same since the window began.
    window: [f64; 2],
    /// How far it is apart from the mean of all, m and rad, fading.
    apart: [f64; 2],
    p: f64,
}

/// The bank.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct BodyLag {
    candidates: [Candidate; LAGS],
    command: [f64; 2],
    frames: u32,
    /// Variances of travel and turn by what the command did between frames.
    between: [f64; 2],
    /// Variances of `apart` over the candidates.
    coherent: [f64; 2],
    late: TimingDeviation,
    window: Window,
    /// Displacement per metre of travel beyond the model, by ground or a fault: m/m and rad/m.
    slip: [f64; 2],
}

/// What is not known of the body because the command changed at some instant between two frames:
/// after a gap it may be about to follow, or have followed long ago. Standard deviations.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct TimingDeviation {
    /// Of yaw rate, rad/s, and speed, m/s.
    rates: [f64; 2],
    /// Of turn, rad, and travel, m, that have come of it, fading.
    moved: [f64; 2],
    /// What was left of that when an observation was completed last.
    told: [f64; 2],
}

impl TimingDeviation {
    /// Lets `dt_s` pass, in which the rates that the command asks for changed by so much.
    fn advance(&mut self, changes: [f64; 2], dt_s: f64, lag_s: f64) {
        let stays = (-dt_s / lag_s).exp();
        for (i, change) in changes.into_iter().enumerate() {
            self.moved[i] += self.rates[i] * lag_s * (1.0 - stays);
            // Between none of it and all that the lag allows, alike.
            let new = change * (1.0 - stays) / 12.0_f64.sqrt();
            self.rates[i] = (self.rates[i] * stays).hypot(new);
        }
    }

    /// Growth of the variances of travel and turn over an observation.
    fn complete(&mut self, fading: f64) -> [f64; 2] {
        let grown = |i: usize| {
            let told = self.told[i];
            (self.moved[i] * self.moved[i] - told * told).max(0.0)
        };
        let grown = [grown(1), grown(0)];
        self.moved = self.moved.map(|moved| fading * moved);
        self.told = self.moved;
        grown
    }
}

/// What was measured since a window began.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct Window {
    observations: u32,
    measured: [f64; 2],
    between: [f64; 2],
    /// Squares by which single displacements were apart from those expected: what the noise of the
    /// measurement is in this window.
    squares: [f64; 2],
}

impl BodyLag {
    /// A bank about a learned time constant `lag_s`, whose logarithm has the deviation
    /// `uncertainty`.
    #[must_use]
    pub fn new(lag_s: f64, uncertainty: f64) -> Self {
        let mut bank = Self::default();
        let apart = |candidate_s: f64| (candidate_s / lag_s.max(LAGS_S[0])).ln();
        for (candidate, candidate_s) in bank.candidates.iter_mut().zip(LAGS_S) {
            let z = apart(candidate_s) / uncertainty.max(1e-3);
            candidate.p = (-0.5 * z * z).exp().max(P_MIN);
        }
        bank.normalise();
        bank
    }

    /// The body moves as commanded, with (curvature 1/m, speed m/s).
    pub fn begin(&mut self, command: [f64; 2]) {
        self.command = command;
        for candidate in &mut self.candidates {
            candidate.body = [command[0] * command[1], command[1]];
        }
    }

    /// Mean of the time constant, s.
    fn lag_s(&self) -> f64 {
        let all = self.candidates.iter().zip(LAGS_S);
        all.map(|(candidate, lag_s)| candidate.p * lag_s).sum()
    }

    /// Takes the command of the next frame, `dt_s` after the one before.
    pub fn advance(&mut self, command: [f64; 2], dt_s: f64) {
        // The command changed at some instant since the last frame.
        let middle: [f64; 2] = std::array::from_fn(|i| 0.5 * (self.command[i] + command[i]));
        let surge_m = (command[1] - self.command[1]) * dt_s;
        let swing_rad = (command[0] - self.command[0]) * middle[1] * dt_s;
        self.between[0] += surge_m * surge_m / 12.0;
        self.between[1] +=
            (swing_rad * swing_rad + middle[0] * middle[0] * surge_m * surge_m) / 12.0;
        let target = [middle[0] * middle[1], middle[1]];
        let turns = command[0] * command[1] - self.command[0] * self.command[1];
        let changes = [turns, command[1] - self.command[1]];
        self.late.advance(changes, dt_s, self.lag_s());
        self.command = command;
        self.frames += 1;
        for (candidate, lag_s) in self.candidates.iter_mut().zip(LAGS_S) {
            let follows = 1.0 - (-dt_s / lag_s).exp();
            let before = candidate.body;
            for (body, target) in candidate.body.iter_mut().zip(target) {
                *body += follows * (target - *body);
            }
            let after = candidate.body;
            candidate.sums[0] += 0.5 * (before[1] + after[1]) * dt_s;
            candidate.sums[1] += 0.5 * (before[0] + after[0]) * dt_s;
            for (middle, sum) in candidate.middles.iter_mut().zip(candidate.sums) {
                *middle += sum;
            }
        }
    }

    /// Forgets where the body was in the frames since the last observation: they are dropped.
    pub(crate) fn drop_frames(&mut self) {
        self.frames = 0;
        for candidate in &mut self.candidates {
            candidate.middles = [0.0; 2];
        }
    }

    /// Closes an observation of `interval_s`.
    pub fn complete(&mut self, interval_s: f64) -> FollowedMotion {
        let frames = f64::from(self.frames.max(1));
        for candidate in &mut self.candidates {
            candidate.moved = candidate.middles.map(|middle| middle / frames);
            for (sum, moved) in candidate.sums.iter_mut().zip(candidate.moved) {
                *sum -= moved;
            }
            candidate.middles = [0.0; 2];
        }
        let mean = |of: &dyn Fn(&Candidate) -> f64| -> f64 {
            self.candidates.iter().map(|c| c.p * of(c)).sum()
        };
        let [travel_m, turn_rad] = [mean(&|c| c.moved[0]), mean(&|c| c.moved[1])];
        let speed_m_s = mean(&|c| c.body[1]);
        // The error of a wrong lag has one sign while the command changes: what counts is the
        // growth of its sum.
        let fading = (-interval_s / COHERENT_S).exp();
        for candidate in &mut self.candidates {
            for (i, mean) in [travel_m, turn_rad].into_iter().enumerate() {
                candidate.apart[i] = fading * candidate.apart[i] + candidate.moved[i] - mean;
            }
        }
        let coherent: [f64; 2] = std::array::from_fn(|i| {
            let squares = self
                .candidates
                .iter()
                .map(|c| c.p * c.apart[i] * c.apart[i]);
            squares.sum()
        });
        let grown: [f64; 2] = std::array::from_fn(|i| (coherent[i] - self.coherent[i]).max(0.0));
        let late = self.late.complete(fading);
        let followed = FollowedMotion {
            travel_m,
            turn_rad,
            speed_m_s,
            travel_variance: self.between[0] + COHERENCE * (grown[0] + late[0]),
            turn_variance: self.between[1] + COHERENCE * (grown[1] + late[1]),
        };
        for (sum, between) in self.window.between.iter_mut().zip(self.between) {
            *sum += between;
        }
        (self.frames, self.between, self.coherent) = (0, [0.0; 2], coherent);
        followed
    }

    /// Forgets the window under way: what was measured before has no relation to what follows.
    pub fn interrupt(&mut self) {
        self.window = Window::default();
        for candidate in &mut self.candidates {
            candidate.window = [0.0; 2];
        }
    }

    /// Takes the measured travel (m) and turn (rad) of the observation that was completed last, and
    /// weighs the candidates at the end of a window. The noise of the measurement over a window has
    /// these variances. `per_metre`: what a metre of commanded travel is expected to be, and what
    /// it turns the robot beyond the commanded curvature; less certain while a fault
    /// `is_suspected`.
    pub fn learn(
        &mut self,
        measured: [f64; 2],
        variance: [f64; 2],
        per_metre: [f64; 2],
        is_suspected: bool,
    ) {
        let mut expected = [0.0; 2];
        for candidate in &mut self.candidates {
            let [travel_m, turn_rad] = candidate.moved;
            let moved = [per_metre[0] * travel_m, turn_rad + per_metre[1] * travel_m];
            for (i, moved) in moved.into_iter().enumerate() {
                candidate.window[i] += moved;
                expected[i] += candidate.p * moved;
            }
        }
        let window = &mut self.window;
        for (i, measured) in measured.into_iter().enumerate() {
            window.measured[i] += measured;
            window.squares[i] += (measured - expected[i]).powi(2);
        }
        window.observations += 1;
        if window.observations >= WINDOW {
            self.weigh(variance, SLIP_SD[usize::from(is_suspected)]);
            self.interrupt();
        }
    }

    /// Weighs the candidates by the window. What the robot slips in all of them alike is no lag.
    fn weigh(&mut self, variance: [f64; 2], slip_sd: f64) {
        let Window {
            observations,
            measured,
            between,
            squares,
        } = self.window;
        // A noisier pose than learned says less; that it is less noisy is not relied on.
        let noise: [f64; 2] =
            std::array::from_fn(|i| variance[i].max(squares[i] / f64::from(observations)));
        let travel_m = self.expected(0);
        let slip_m = slip_sd * travel_m;
        let spread: [f64; 2] = std::array::from_fn(|i| noise[i] + slip_m * slip_m + between[i]);
        let apart = |candidate: &Candidate, i: usize| {
            measured[i] - self.slip[i] * travel_m - candidate.window[i]
        };
        let fits = self.candidates.each_ref().map(|candidate| {
            let square = |i: usize| apart(candidate, i).powi(2) / spread[i];
            -0.5 * (square(0) + square(1))
        });
        let best = fits.into_iter().fold(f64::NEG_INFINITY, f64::max);
        if !best.is_finite() {
            return;
        }
        for (candidate, fit) in self.candidates.iter_mut().zip(fits) {
            candidate.p *= (fit - best).max(-GAIN_MAX).exp();
        }
        self.normalise();
        // What no lag explains is slip; of a short travel the noise says nothing about it.
        for i in 0..2 {
            let slipped = measured[i] - self.slip[i] * travel_m - self.expected(i);
            let gain = SLIP_SHARE * slip_m * slip_m / (noise[i] + slip_m * slip_m);
            if gain > 0.0 {
                self.slip[i] += gain * slipped / travel_m;
            }
        }
    }

    /// Expected travel (m) or turn (rad) since the window began.
    fn expected(&self, i: usize) -> f64 {
        self.candidates.iter().map(|c| c.p * c.window[i]).sum()
    }

    fn normalise(&mut self) {
        let total: f64 = self.candidates.iter().map(|c| c.p).sum();
        for candidate in &mut self.candidates {
            candidate.p = (candidate.p / total).max(P_MIN);
        }
        let total: f64 = self.candidates.iter().map(|c| c.p).sum();
        for candidate in &mut self.candidates {
            candidate.p /= total;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body with the lag `true_s` whose speed is commanded to and fro every 2 s; the bank's mean
    /// lag after `changes`, and the largest travel error in deviations of the last two changes.
    fn drive(true_s: f64, changes: usize) -> (f64, f64) {
        const DT_S: f64 = 0.01;
        let mut bank = BodyLag::new(0.1, 0.5);
        let mut body = 0.1;
        bank.begin([0.5, body]);
        let (mut sum, mut middle, mut worst) = (0.0, 0.0, 0.0_f64);
        for k in 0..changes * 200 {
            let command = if k / 200 % 2 == 0 { 0.3 } else { 0.1 };
            let before = body;
            body += (1.0 - (-DT_S / true_s).exp()) * (command - body);
            sum += 0.5 * (before + body) * DT_S;
            middle += sum;
            bank.advance([0.5, command], DT_S);
            if k % 5 == 4 {
                let travel_m = middle / 5.0;
                (sum, middle) = (sum - travel_m, 0.0);
                let followed = bank.complete(0.05);
                let apart = (travel_m - followed.travel_m).abs();
                if k / 200 + 2 >= changes {
                    worst = worst.max(apart / (followed.travel_variance + 1e-7).sqrt());
                }
                let measured = [0.97 * travel_m, 0.5 * travel_m];
                bank.learn(measured, [1e-5, 1e-5], [0.97, 0.0], false);
            }
        }
        (bank.lag_s(), worst)
    }

    #[test]
    fn the_lag_is_learned_from_changes_of_the_command() {
        for true_s in [0.02, 0.05, 0.1, 0.2, 0.3, 0.5] {
            let (lag_s, worst) = drive(true_s, 12);
            let near = (lag_s - true_s).abs() < 0.35 * true_s + 0.03;
            assert!(near, "{true_s}: {lag_s}");
            assert!(worst < 4.0, "{true_s}: {worst}");
        }
    }

    #[test]
    fn a_pose_noisier_than_learned_and_a_stop_on_an_outlier_teach_no_wrong_lag() {
        const TRUE_S: f64 = 0.3;
        let mut bank = BodyLag::new(0.1, 0.5);
        bank.begin([0.5, 0.0]);
        // The measurement is believed to be four times as precise as it is.
        let believed = [(0.007_f64).powi(2); 2];
        let mut seed = 1_u64;
        let mut noise = || {
            let mut uniform = || {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (seed >> 33) as f64 / (1_u64 << 31) as f64 - 0.5
            };
            0.02 * (0..12).map(|_| uniform()).sum::<f64>()
        };
        let (mut body, mut before) = (0.0, 0.0);
        for k in 0..1200 {
            // Half a minute of changes, then it stands; one pose jumps by 0.2 m and back.
            let command = if k < 600 && k / 40 % 2 == 0 { 0.3 } else { 0.0 };
            let moved = body;
            body += (1.0 - (-0.05_f64 / TRUE_S).exp()) * (command - body);
            bank.advance([0.5, command], 0.05);
            bank.complete(0.05);
            let apart = noise() + if k == 699 { 0.2 } else { 0.0 };
            let travel_m = 0.5 * (moved + body) * 0.05;
            let measured = [travel_m + apart - before, 0.5 * travel_m];
            bank.learn(measured, believed, [1.0, 0.0], false);
            before = apart;
            assert!(bank.slip[0].abs() < 0.1, "{k}: slip {}", bank.slip[0]);
        }
        let lag_s = bank.lag_s();
        assert!((lag_s - TRUE_S).abs() < 0.1, "{lag_s}");
    }

    #[test]
    fn after_a_gap_the_body_is_unsure_of_what_it_still_follows_and_then_sure_again() {
        let mut late = TimingDeviation::default();
        // The speed changed in a gap of half a second; then nothing happens.
        late.advance([0.0, 0.2], 0.5, 0.1);
        late.advance([0.0; 2], 0.05, 0.1);
        let [travel, turn] = late.complete(0.98);
        assert!(travel > 1e-6 && turn == 0.0);
        // Ten lags on it has followed, whenever the change was.
        (0..20).for_each(|_| late.advance([0.0; 2], 0.05, 0.1));
        late.complete(0.98);
        late.advance([0.0; 2], 0.05, 0.1);
        let [travel, _] = late.complete(0.98);
        assert!(travel < 1e-6, "{travel}");
    }

    #[test]
    fn a_constant_command_teaches_nothing_whatever_the_robot_does() {
        let mut bank = BodyLag::new(0.1, 0.5);
        bank.begin([0.2, 0.2]);
        let before = bank.lag_s();
        for _ in 0..10_000 {
            bank.advance([0.2, 0.2], 0.01);
            let followed = bank.complete(0.01);
            // The robot slips by a third and drifts.
            let measured = [0.66 * followed.travel_m, followed.turn_rad + 1e-3];
            bank.learn(measured, [1e-8, 1e-8], [1.0, 0.0], true);
        }
        assert!((bank.lag_s() - before).abs() < 1e-9);
    }
}
