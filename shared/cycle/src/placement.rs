//! Core, scheduling policy and memory lock of the calling thread: asked for, then read back.

/// What a service asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlacementRequest {
    /// Core to run on.
    pub core: usize,
    /// `SCHED_FIFO` priority; 0 for `SCHED_OTHER`.
    pub priority: u8,
}

/// What the kernel says after [`apply`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placement {
    /// Core on which the thread runs now.
    pub core: usize,
    /// True if the core that was asked for is the only one it may run on.
    pub pinned: bool,
    /// Scheduling policy (`SCHED_FIFO` is 1, `SCHED_OTHER` 0).
    pub policy: u32,
    /// Real-time priority; 0 under `SCHED_OTHER`.
    pub priority: u32,
    /// True if all present and future memory is locked.
    pub memory_locked: bool,
}

impl Placement {
    /// `fifo:<priority>` or `other`, as reports print it.
    #[must_use]
    pub fn scheduling(policy: u32, priority: u32) -> String {
        if policy == libc::SCHED_FIFO as u32 {
            format!("fifo:{priority}")
        } else {
            "other".into()
        }
    }
}

/// Pins the calling thread, asks for the wanted class, locked memory and 1 ns of timer slack, and
/// reads back what came of it. What is not permitted is left as it is: the caller reports it.
#[must_use]
pub fn apply(wanted: PlacementRequest) -> Placement {
    pin(wanted.core);
    let param = libc::sched_param {
        sched_priority: i32::from(wanted.priority),
    };
    let class = if wanted.priority > 0 {
        libc::SCHED_FIFO
    } else {
        libc::SCHED_OTHER
    };
    // SAFETY: plain system calls on the calling thread; `param` outlives the call. Failure leaves
    // the thread as it was and shows in `read_back`.
    #[allow(unsafe_code)]
    let locked = unsafe {
        libc::sched_setscheduler(0, class, &raw const param);
        libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64, 0_u64, 0_u64, 0_u64);
        libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) == 0
    };
    Placement {
        memory_locked: locked,
        ..read_back(wanted.core)
    }
}

/// Lets the calling thread, and those that it starts, run on all cores but these, behind everybody
/// else. If there are no others, it runs on all.
pub fn keep_off(cores: &[usize]) {
    // SAFETY: plain system calls on the calling thread; the sets are local and of the size that is
    // given. Failure leaves the thread as it was.
    #[allow(unsafe_code)]
    unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        let size = size_of::<libc::cpu_set_t>();
        if libc::sched_getaffinity(0, size, &raw mut set) == 0 {
            for &core in cores
                .iter()
                .filter(|core| **core < libc::CPU_SETSIZE as usize)
            {
                libc::CPU_CLR(core, &mut set);
            }
            if libc::CPU_COUNT(&set) > 0 {
                libc::sched_setaffinity(0, size, &raw const set);
            }
        }
        libc::setpriority(libc::PRIO_PROCESS, 0, 15);
    }
}

/// Lets the calling thread run on this core only; false if that is not permitted or there is no
/// such core.
pub fn pin(core: usize) -> bool {
    // The library takes a number beyond the kernel's for a mistake of the program.
    core < libc::CPU_SETSIZE as usize
        && core_affinity::set_for_current(core_affinity::CoreId { id: core })
}

/// Core on which the calling thread runs at this moment.
#[must_use]
pub fn current_core() -> usize {
    // SAFETY: no arguments, no effects.
    #[allow(unsafe_code)]
    let core = unsafe { libc::sched_getcpu() };
    usize::try_from(core).unwrap_or(usize::MAX)
}

/// Timer slack of the calling thread, ns: 1 after [`apply`], 0 where a real-time class has none.
#[must_use]
pub fn timer_slack_ns() -> Option<u64> {
    // SAFETY: a plain system call on the calling thread.
    #[allow(unsafe_code)]
    let slack_ns = unsafe { libc::prctl(libc::PR_GET_TIMERSLACK, 0_u64, 0_u64, 0_u64, 0_u64) };
    u64::try_from(slack_ns).ok()
}

/// Reads the placement of the calling thread, which was to run on `core`, from the kernel
/// (`memory_locked` is not known here and false).
#[must_use]
pub fn read_back(core: usize) -> Placement {
    let mut param = libc::sched_param { sched_priority: 0 };
    // SAFETY: both calls only write into the locals that they are given; the cpu set is plain bits.
    #[allow(unsafe_code)]
    let (policy, pinned) = unsafe {
        let policy = libc::sched_getscheduler(0);
        libc::sched_getparam(0, &raw mut param);
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::sched_getaffinity(0, size_of::<libc::cpu_set_t>(), &raw mut set);
        let is_in = core < libc::CPU_SETSIZE as usize && libc::CPU_ISSET(core, &set);
        (policy, is_in && libc::CPU_COUNT(&set) == 1)
    };
    Placement {
        core: current_core(),
        pinned,
        policy: u32::try_from(policy).unwrap_or(u32::MAX),
        priority: u32::try_from(param.sched_priority).unwrap_or(0),
        memory_locked: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cores that the calling thread may run on.
    fn cores() -> Vec<usize> {
        let ids = core_affinity::get_core_ids().unwrap();
        ids.into_iter().map(|it| it.id).collect()
    }

    /// How far behind others the calling thread is.
    fn nice() -> i32 {
        // SAFETY: a plain system call on the calling thread.
        #[allow(unsafe_code)]
        unsafe {
            libc::getpriority(libc::PRIO_PROCESS, 0)
        }
    }

    #[test]
    fn who_keeps_off_cores_runs_on_the_others_if_there_are_any_and_behind_everybody_else() {
        let all = cores();
        let observer = std::thread::spawn(move || {
            let before = nice();
            keep_off(&[all[0], usize::MAX]);
            let others = cores();
            match all.len() {
                1 => assert_eq!(others, all),
                _ => assert_eq!(others, all[1..]),
            }
            keep_off(&all);
            assert_eq!(cores(), others, "there are no others");
            // Without a privilege nobody comes forward.
            assert_eq!(nice().max(before), before.max(15));
        });
        observer.join().unwrap();
    }
}
