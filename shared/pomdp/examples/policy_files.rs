//! A policy in a file: solved, made small, valued, written and read back.
//!
//! ```text
//! all: earns 4.54 to 4.54
//! few: earns 4.54 to 4.54
//! refused: a policy of the model 181e38d3ddb5e23a, not of b2b95bcd8acea79f
//! ```

use std::error::Error;

use vigil_pomdp::policy_file::{PolicyFile, PolicyFileError, alpha, appl};
use vigil_pomdp::solver::{self, Options};
use vigil_pomdp::{Budget, PointBased, Pomdp};

/// Beliefs that the value of a policy rests on, at most.
const BELIEFS_MAX: usize = 10_000;

fn main() -> Result<(), Box<dyn Error>> {
    let text = include_str!("gearbox.pomdp");
    let model = Pomdp::parse(text)?;
    let (mut stop, mut watch) = (|| false, |_: &solver::Progress| ());
    let mut budget = Budget::new(&mut stop);
    let options = Options {
        precision: 0.01,
        ..Options::default()
    };
    let found = solver::solve(&model, &options, &mut budget, &mut watch)?;
    let vectors = found.vectors.ok_or("no policy yet")?;

    // Few vectors decide faster; what they lose is known before anybody relies on them.
    let small = solver::compact(&model, &vectors, 8, &mut budget)?;
    for (name, vectors) in [("all", &vectors), ("few", &small.vectors)] {
        let mut policy = PointBased::new(&model, vectors)?;
        let value = solver::policy_value(&model, &mut policy, BELIEFS_MAX, &mut budget)?;
        println!("{name}: earns {:.2} to {:.2}", value.lower, value.upper);
    }

    let file = PolicyFile {
        model_hash: model.hash(),
        discount: model.discount(),
        method: "sarsop".to_owned(),
        lower: found.bracket.lower - small.loss_mean - 4.0 * small.loss_error,
        upper: Some(found.bracket.upper),
        // The crate has no clock; whoever measures the time writes it here.
        cpu_s: 0.0,
        vectors: small.vectors,
    };
    let path = std::env::temp_dir().join(format!("gearbox-{}.json", std::process::id()));
    std::fs::write(&path, file.write(&model)?)?;
    let bytes = std::fs::read(&path)?;
    std::fs::remove_file(&path)?;
    assert_eq!(PolicyFile::read(&bytes, &model)?, file);

    // A policy of another model is refused.
    let other = Pomdp::parse(&text.replace("0.9 0.1", "0.8 0.2"))?;
    if let Err(PolicyFileError::Model { found, wanted }) = PolicyFile::read(&bytes, &other) {
        println!("refused: a policy of the model {found}, not of {wanted}");
    }

    // Other programs read these.
    assert_eq!(
        appl::read(&appl::write(&file.vectors, "gearbox"), &model)?,
        file.vectors
    );
    assert_eq!(
        alpha::read(&alpha::write(&file.vectors), &model)?,
        file.vectors
    );
    Ok(())
}
