//! What every measuring program shares: the archive, and the facts about the machine.

pub mod archive;
pub mod machine;
