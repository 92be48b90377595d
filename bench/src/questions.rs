//! The questions, and what the options of several of them share.

pub mod attribution;
pub mod bits;
pub mod derived;
pub mod detection;
pub mod fault_sets;
pub mod field;
pub mod figure7;
pub mod filters;
pub mod first_light;
pub mod flood;
pub mod ground;
pub mod guard;
pub mod healthy;
pub mod instructions;
pub mod latency;
pub mod look_ahead;
pub mod missions;
pub mod observers;
pub mod peers;
pub mod pomdp_bounds;
pub mod pomdp_compare;
pub mod pomdp_learning;
pub mod pomdp_update;
pub mod publishers;
pub mod robots;
pub mod rover13;
pub mod two_wheels;
pub mod unmodelled;

/// The only option of several questions.
#[derive(Debug, clap::Args)]
pub struct Json {
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// A finite number of at least 0.
fn from_zero(text: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    let number = number.filter(|n: &f64| n.is_finite() && *n >= 0.0);
    number.ok_or_else(|| "allowed is a number from 0".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_from_0_are_read_and_others_refused() {
        assert_eq!(from_zero("0"), Ok(0.0));
        assert_eq!(from_zero("1.5"), Ok(1.5));
        for wrong in ["-1", "inf", "NaN", "many", ""] {
            assert!(from_zero(wrong).is_err(), "{wrong}");
        }
    }
}
