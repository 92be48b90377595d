//! Whether a service that has died is started again, and when.

use std::fmt;
use std::time::{Duration, Instant};

use vigil_cycle::failure::Failure;
use vigil_cycle::serve::{EXIT_MISSED, EXIT_REFUSED};

/// When a service is given up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestartPolicy {
    /// Restarts of one service within `window`.
    pub max_restarts: usize,
    /// See `max_restarts`.
    pub window: Duration,
    /// Delay before the first restart, doubled at each further one within the window.
    pub delay: Duration,
}

/// How a service ended.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Death {
    /// Its exit code; `None` after a signal.
    pub code: Option<i32>,
    /// The assertion that ended it.
    pub failure: Option<Failure>,
    /// False for a source that could only begin its recording again.
    pub can_resume: bool,
}

/// Why a service is not started again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum GiveUpReason {
    /// It was started again so many times within the window.
    Restarts(usize),
    /// It refused its configuration: a second start would refuse it as well.
    Refused,
    /// It missed a deadline, and that was to end it.
    MissedDeadline,
    /// It could only begin its recording again.
    CannotResume,
    /// An assertion failed that had failed before, at this place: the cause is not the moment's.
    SameAssertion(String),
}

impl fmt::Display for GiveUpReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Restarts(count) => write!(f, "{count} restarts within the window"),
            Self::Refused => write!(f, "it refuses its configuration"),
            Self::MissedDeadline => write!(f, "it missed a deadline"),
            Self::CannotResume => write!(f, "it cannot go on within its recording"),
            Self::SameAssertion(location) => {
                write!(f, "the same assertion failed again ({location})")
            }
        }
    }
}

/// The restarts of one service.
#[derive(Debug, Clone)]
pub struct RestartHistory {
    policy: RestartPolicy,
    /// Those within the window.
    recent: Vec<Instant>,
    count: usize,
    /// Places of the assertions that have failed.
    failed_at: Vec<String>,
}

impl RestartHistory {
    /// No restart so far.
    pub const fn new(policy: RestartPolicy) -> Self {
        Self {
            policy,
            recent: Vec::new(),
            count: 0,
            failed_at: Vec::new(),
        }
    }

    /// Takes a death at `now`: the delay before the next start, or why there is none.
    pub fn judge(&mut self, death: &Death, now: Instant) -> Result<Duration, GiveUpReason> {
        let window = self.policy.window;
        self.recent.retain(|at| now.duration_since(*at) < window);
        if let Some(failure) = &death.failure {
            if self.failed_at.contains(&failure.location) {
                return Err(GiveUpReason::SameAssertion(failure.location.clone()));
            }
            self.failed_at.push(failure.location.clone());
        }
        if death.code == Some(EXIT_REFUSED.into()) {
            return Err(GiveUpReason::Refused);
        }
        if death.code == Some(EXIT_MISSED.into()) {
            return Err(GiveUpReason::MissedDeadline);
        }
        if !death.can_resume {
            return Err(GiveUpReason::CannotResume);
        }
        let count = self.recent.len();
        if count >= self.policy.max_restarts {
            return Err(GiveUpReason::Restarts(count));
        }
        // 20 doublings are a week at the shortest delay: no factor overflows.
        Ok(self.policy.delay.saturating_mul(1 << count.min(20)))
    }

    /// The service has been started again at `now`.
    pub fn restarted(&mut self, now: Instant) {
        self.recent.push(now);
        self.count += 1;
        assert!(
            self.recent.len() <= self.policy.max_restarts,
            "a window holds no more restarts than allowed: {} of {}",
            self.recent.len(),
            self.policy.max_restarts
        );
    }

    /// Restarts so far.
    pub const fn count(&self) -> usize {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POLICY: RestartPolicy = RestartPolicy {
        max_restarts: 3,
        window: Duration::from_secs(60),
        delay: Duration::from_millis(20),
    };

    fn killed() -> Death {
        Death {
            can_resume: true,
            ..Death::default()
        }
    }

    fn failed(location: &str) -> Death {
        Death {
            code: Some(70),
            failure: Some(Failure {
                t_ns: 0,
                location: location.into(),
                work: "at the start".into(),
                message: "counters add up".into(),
            }),
            ..killed()
        }
    }

    #[test]
    fn delays_double_until_the_window_is_full_and_begin_anew_when_it_is_empty() {
        let (mut history, start) = (RestartHistory::new(POLICY), Instant::now());
        for (second, delay_ms) in [(0, 20), (1, 40), (2, 80)] {
            let now = start + Duration::from_secs(second);
            let delay = history.judge(&killed(), now);
            assert_eq!(delay, Ok(Duration::from_millis(delay_ms)));
            history.restarted(now);
        }
        let judge = |history: &mut RestartHistory, second| {
            history.judge(&killed(), start + Duration::from_secs(second))
        };
        assert_eq!(judge(&mut history, 59), Err(GiveUpReason::Restarts(3)));
        // The first has left the window, then all.
        assert_eq!(judge(&mut history, 60), Ok(Duration::from_millis(80)));
        assert_eq!(judge(&mut history, 99), Ok(Duration::from_millis(20)));
        assert_eq!(history.count(), 3);
    }

    #[test]
    fn what_a_restart_cannot_mend_is_given_up_at_once() {
        let give_up = |code, can_resume| {
            let death = Death {
                code: Some(code),
                can_resume,
                failure: None,
            };
            RestartHistory::new(POLICY).judge(&death, Instant::now())
        };
        assert_eq!(give_up(2, true), Err(GiveUpReason::Refused));
        assert_eq!(give_up(3, true), Err(GiveUpReason::MissedDeadline));
        assert_eq!(give_up(1, false), Err(GiveUpReason::CannotResume));
        assert_eq!(give_up(1, true), Ok(POLICY.delay));
    }

    #[test]
    fn the_same_assertion_fails_twice_at_most_whatever_lies_between() {
        let (mut history, start) = (RestartHistory::new(POLICY), Instant::now());
        let mut judge = |location: &str, second| {
            history.judge(&failed(location), start + Duration::from_secs(second))
        };
        assert!(judge("deadline.rs:7:9", 0).is_ok());
        assert!(judge("health.rs:8:9", 1).is_ok());
        let again = judge("deadline.rs:7:9", 9_999).unwrap_err();
        assert_eq!(
            again.to_string(),
            "the same assertion failed again (deadline.rs:7:9)"
        );
    }

    #[test]
    #[should_panic(expected = "a window holds no more restarts than allowed: 4 of 3")]
    fn a_restart_too_many_is_found() {
        let mut history = RestartHistory::new(POLICY);
        (0..4).for_each(|_| history.restarted(Instant::now()));
    }
}
