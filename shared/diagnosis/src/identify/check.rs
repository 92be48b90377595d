//! What an identifier refuses.

use crate::settings;
use vigil_blocks::PARTICLE_CAPACITY;

use crate::identify::modes::IdentifierError;

/// Why another filter is refused.
pub const FURTHER_NEED_HYPOTHESES: &str =
    "leaves steer, pose, torque, current and gyro need identifier.filter = \"multiple-hypothesis\"";

/// Refuses settings out of range.
///
/// # Errors
/// [`IdentifierError::Value`].
pub fn check(settings: &settings::Identifier) -> Result<(), IdentifierError> {
    let refuse = |key, value, allowed| {
        Err(IdentifierError::Value {
            key,
            value,
            allowed,
        })
    };
    let particles = settings.particles.unwrap_or(settings::PARTICLES);
    if !(32..=PARTICLE_CAPACITY).contains(&particles) {
        return refuse("particles", particles as f64, "32 to 1024");
    }
    if !(0.5..=30.0).contains(&settings.ring_s) {
        return refuse("ring_s", settings.ring_s, "0.5 to 30");
    }
    if !(0.0..=0.5).contains(&settings.p_unknown) {
        return refuse("p_unknown", settings.p_unknown, "0 to 0.5");
    }
    Ok(())
}
