//! Fewer hypotheses or particles before a missed deadline; both are called particles here.
//!
//! A cycle that takes nearly all the time that it has is a warning: its budget, or less if its
//! input came so late that the deadline is nearer. Single ones are the machine's (a processor
//! taken away for a while lengthens whatever runs), so a few in one window are needed, and the
//! shortest of them says what the work itself costs. The allowance then falls in proportion to what
//! was in use, and returns step by step once long windows stay far below what they have. A cycle
//! that worked on no particle is no warning: shedding would not help.

use crate::deadline::Schedule;

/// Share of its time above which a cycle counts as a warning. Chosen by hand, as are the two below:
/// far enough apart that the number of particles does not swing.
const WARNING: f64 = 0.8;
/// Share of its time that a smaller number of particles is to take.
const AIM: f64 = 0.5;
/// Share of its time below which there is room for more.
const ROOM: f64 = 0.4;
/// Share of the deadline that a cycle has at least: a later wake-up is the machine's, and fewer
/// particles would not help. Chosen by hand: smaller sheds particles for late wake-ups; larger
/// overlooks late input that leaves too little time.
const TIME_MIN: f64 = 0.5;
/// Warnings in one window after which particles are shed: half of a second's observations. Chosen
/// by hand: fewer shed for one stall of the machine, more leave deadlines to be missed.
const WARNINGS: u32 = 10;
/// Length of a window, ns, and cycles in it at least: filters work on every observation, some
/// twenty times a second, however short the cycles between are. A second of few cycles holds too
/// few for so many warnings: below 256 Hz a window is longer.
const WINDOW_NS: u64 = 1_000_000_000;
const WINDOW_CYCLES_MIN: u64 = 256;
/// Windows with room, in a row, before particles are given back. Chosen by hand: fewer swing
/// between shedding and giving back under a load that comes and goes.
const CALM_WINDOWS: u32 = 4;
/// Factor on the particles each time they are given back: from [`ROOM`] to 0.6 of the time, below
/// [`WARNING`].
const GIVE_BACK: f64 = 1.5;
/// Never fewer particles, unless fewer are configured: as many as the modes of a rover's faults, so
/// that most have one.
const PARTICLES_MIN: u32 = 32;

/// Decides how many particles the time allows.
#[derive(Debug, Clone)]
pub struct Shedder {
    configured: u32,
    allowed: u32,
    schedule: Schedule,
    /// Cycles in a window.
    window: u32,
    cycles: u32,
    warnings: u32,
    /// Share of its time that the shortest of the cycles took that were warnings.
    shortest: f64,
    without_room: u32,
    calm_windows: u32,
}

impl Shedder {
    /// For `configured` particles and the cycles of this schedule.
    #[must_use]
    pub fn new(configured: u32, schedule: Schedule) -> Self {
        let window = (WINDOW_NS / schedule.period_ns.max(1)).max(WINDOW_CYCLES_MIN);
        Self {
            configured,
            allowed: configured,
            schedule,
            window: u32::try_from(window).unwrap_or(u32::MAX),
            cycles: 0,
            warnings: 0,
            shortest: f64::INFINITY,
            without_room: 0,
            calm_windows: 0,
        }
    }

    /// Share of the time that it had of a cycle that took `cycle_ns` and was woken so long after
    /// its instant of the schedule, ns.
    fn share(&self, cycle_ns: u64, woken_after_ns: u64) -> f64 {
        let deadline_ns = self.schedule.deadline_ns as f64;
        let left_ns = (deadline_ns - woken_after_ns as f64).max(TIME_MIN * deadline_ns);
        cycle_ns as f64 / left_ns.min(self.schedule.budget_ns as f64).max(1.0)
    }

    /// Particles allowed at present.
    #[must_use]
    pub const fn allowed(&self) -> u32 {
        self.allowed
    }

    /// Particles configured.
    #[must_use]
    pub const fn configured(&self) -> u32 {
        self.configured
    }

    /// Takes the time of a cycle from wake-up to publication, and how long after its instant of the
    /// schedule it was woken, ns, and the particles that it worked on; the new allowance if it
    /// changes.
    pub fn take(&mut self, cycle_ns: u64, woken_after_ns: u64, in_use: u32) -> Option<u32> {
        let share = self.share(cycle_ns, woken_after_ns);
        self.cycles += 1;
        self.without_room += u32::from(share > ROOM);
        if share > WARNING && in_use > 0 {
            self.warnings += 1;
            self.shortest = self.shortest.min(share);
        }
        if self.warnings == WARNINGS {
            let in_use = self.allowed.min(in_use);
            let fewer = (f64::from(in_use) * AIM / self.shortest) as u32;
            self.begin_window();
            self.calm_windows = 0;
            return self.allow(fewer.max(PARTICLES_MIN));
        }
        if self.cycles < self.window {
            return None;
        }
        let is_calm = self.without_room < WARNINGS;
        self.begin_window();
        self.calm_windows = if is_calm { self.calm_windows + 1 } else { 0 };
        if self.calm_windows < CALM_WINDOWS {
            return None;
        }
        self.calm_windows = 0;
        self.allow((f64::from(self.allowed) * GIVE_BACK).ceil() as u32)
    }

    const fn begin_window(&mut self) {
        (self.cycles, self.warnings, self.without_room) = (0, 0, 0);
        self.shortest = f64::INFINITY;
    }

    fn allow(&mut self, particles: u32) -> Option<u32> {
        let particles = particles.min(self.configured);
        assert!(
            particles >= self.configured.min(PARTICLES_MIN),
            "some particles are always allowed: {particles} of {}",
            self.configured
        );
        let is_new = particles != self.allowed;
        self.allowed = particles;
        is_new.then_some(particles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUDGET_NS: u64 = 500_000;

    fn shedder(configured: u32, period_ns: u64) -> Shedder {
        let schedule = Schedule {
            period_ns,
            deadline_ns: period_ns.max(BUDGET_NS),
            budget_ns: BUDGET_NS,
        };
        Shedder::new(configured, schedule)
    }

    /// Runs `cycles` cycles that cost `ns_a_particle` for each; returns the allowance at the end.
    fn run(shedder: &mut Shedder, cycles: u32, ns_a_particle: u64) -> u32 {
        for _ in 0..cycles {
            let in_use = shedder.allowed();
            shedder.take(ns_a_particle * u64::from(in_use), 0, in_use);
        }
        shedder.allowed()
    }

    #[test]
    fn particles_are_shed_before_the_budget_is_spent_and_given_back_when_there_is_room() {
        let mut shedder = shedder(1000, 1_000_000);
        assert_eq!(run(&mut shedder, 2000, 350), 1000, "70 % of the budget");
        // 90 % of the budget: down to half of it at the tenth such cycle.
        assert_eq!(run(&mut shedder, 9, 450), 1000);
        assert_eq!(run(&mut shedder, 1, 450), 555);
        assert_eq!(run(&mut shedder, 5000, 450), 555, "it stays there");
        // The work becomes cheaper: 33 %, then 50 % of the budget.
        assert_eq!(run(&mut shedder, 5000, 300), 833);
        assert_eq!(run(&mut shedder, 5000, 200), 1000);
    }

    #[test]
    fn single_stalls_of_the_machine_shed_nothing() {
        let mut shedder = shedder(1000, 1_000_000);
        for cycle in 0..100_000 {
            let cycle_ns = if cycle % 200 == 0 { 20_000_000 } else { 50_000 };
            assert_eq!(shedder.take(cycle_ns, 0, 1000), None, "cycle {cycle}");
        }
    }

    #[test]
    fn heavy_cycles_between_light_ones_count() {
        // An observation each 50 ms, at 1 kHz and at 5 kHz.
        for (period_ns, each) in [(1_000_000, 50), (200_000, 250)] {
            let mut shedder = shedder(1000, period_ns);
            let found = (0..10 * each).find_map(|cycle: u32| {
                let is_heavy = cycle.is_multiple_of(each);
                shedder.take(if is_heavy { 480_000 } else { 5_000 }, 0, 1000)
            });
            assert_eq!(found, Some(520), "{period_ns} ns");
        }
    }

    #[test]
    fn input_that_comes_late_leaves_less_time() {
        let schedule = Schedule {
            period_ns: 1_000_000,
            deadline_ns: 750_000,
            budget_ns: 750_000,
        };
        let run = |cycle_ns: u64, woken_after_ns: u64| {
            let mut shedder = Shedder::new(1000, schedule);
            for _ in 0..2000 {
                let allowed = shedder.allowed();
                let cycle_ns = cycle_ns * u64::from(allowed) / 1000;
                shedder.take(cycle_ns, woken_after_ns, allowed);
            }
            shedder.allowed()
        };
        // 520 us are 69 % of the budget, but all there is between 230 and 750 us: half of it.
        assert_eq!([run(520_000, 0), run(520_000, 230_000)], [1000, 500]);
        // Woken after the deadline: held up by something else, whatever it computes.
        assert_eq!([run(200_000, 900_000), run(200_000, u64::MAX)], [1000; 2]);
    }

    #[test]
    fn what_is_shed_is_what_was_in_use() {
        let mut shedder = shedder(1000, 1_000_000);
        let mut take =
            |cycles: u32, in_use: u32| (0..cycles).find_map(|_| shedder.take(450_000, 0, in_use));
        assert_eq!(take(5000, 0), None, "no particle has cost anything");
        assert_eq!(take(10, 200), Some(111));
    }

    #[test]
    fn there_are_always_some_particles() {
        let mut many = shedder(1000, 1_000_000);
        assert_eq!(run(&mut many, 1000, 1_000_000), PARTICLES_MIN);
        let mut few = shedder(8, 1_000_000);
        assert_eq!(run(&mut few, 1000, 1_000_000), 8);
    }

    #[test]
    #[should_panic(expected = "some particles are always allowed: 3 of 1000")]
    fn an_allowance_of_too_few_particles_is_found() {
        shedder(1000, 1_000_000).allow(3);
    }
}
