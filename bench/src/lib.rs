//! What measuring programs share: the archive, the facts about the machine, workloads and
//! yardsticks.

pub mod archive;
pub mod machine;
pub mod naive;
pub mod workload;
