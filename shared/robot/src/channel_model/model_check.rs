//! Checks of the parts of a model of channels.

use super::DRIVES_MAX;
use super::channel::{Channel, Regressor, Term};
use super::observation::{DEPTH, SMOOTHING_S};
use super::scatter::{Scatter, ScatterLaw};
use crate::learned::model::ModelError;
use crate::model_file::refuse;

/// Largest weight of a term.
const WEIGHT_MAX: f64 = 1e9;
/// Terms of a channel. Of four axes to the fourth order learning makes 70 products, 32 lagged axes,
/// 32 smoothed ones and 8 senses. Smaller refuses such a model; larger only lets a file cost more
/// time.
const TERMS_MAX: usize = 160;
/// Largest order of a polynomial.
const ORDER_MAX: u32 = 4;
// The messages name these as numbers.
const _: () = assert!(TERMS_MAX == 160 && DEPTH == 9 && ORDER_MAX == 4);

/// Checks the numbers of a channel; `axes`: how many there are.
pub(super) fn check_channel(key: &str, channel: &Channel, axes: usize) -> Result<(), ModelError> {
    let (terms, weights) = (channel.terms.len(), channel.weights.len());
    if terms != weights || terms > TERMS_MAX {
        let found = format!("{terms} terms and {weights} weights");
        return refuse(key, found, "as many weights as terms, at most 160");
    }
    for (i, term) in channel.terms.iter().enumerate() {
        check_term(&format!("{key}.terms.{i}"), term, axes)?;
    }
    let is_large = |weight: &&f64| weight.is_nan() || weight.abs() > WEIGHT_MAX;
    if let Some(weight) = channel.weights.iter().find(is_large) {
        return refuse(format!("{key}.weights"), weight, "numbers up to 1e9");
    }
    if !channel.variance[0].is_normal() {
        let found = channel.variance[0];
        return refuse(format!("{key}.variance"), found, "above 0 at first");
    }
    let variance = channel.variance.iter().map(|value| ("variance", value));
    let others = [
        ("usual", &channel.usual),
        ("held_out_ratio", &channel.held_out_ratio),
        ("silence_s", &channel.silence_s),
    ];
    let context = channel.context_sd.iter().map(|value| ("context_sd", value));
    for (name, value) in variance.chain(others).chain(context) {
        if !(value.is_finite() && *value >= 0.0) {
            return refuse(format!("{key}.{name}"), value, "a finite number from 0");
        }
    }
    Ok(())
}

/// Checks the law of the roughness.
pub(super) fn check_scatter(scatter: &Scatter, channels: usize) -> Result<(), ModelError> {
    let rows = scatter.covariance.iter().all(|row| row.len() == channels);
    let sizes = scatter.mean.len() == channels && scatter.covariance.len() == channels && rows;
    let mut values = scatter
        .mean
        .iter()
        .chain(scatter.covariance.iter().flatten());
    let bounded = values.all(|value| value.abs() <= 1e6);
    let n = scatter.covariance.len();
    let of = &scatter.covariance;
    let sound = |i: usize| of[i][i] >= 1e-6 && (0..i).all(|j| (of[i][j] - of[j][i]).abs() < 1e-9);
    let places: Vec<usize> = (0..n).collect();
    if sizes && bounded && (0..n).all(sound) && ScatterLaw::new(scatter, &places).is_some() {
        return Ok(());
    }
    let found = format!("{} means", scatter.mean.len());
    refuse(
        "scatter",
        found,
        "a mean for each channel and a covariance, all up to 1e6, each variance from 1e-6",
    )
}

/// Checks that a term points at what exists.
pub(super) fn check_term(key: &str, term: &Term, axes: usize) -> Result<(), ModelError> {
    if term.lag >= DEPTH {
        return refuse(format!("{key}.lag"), term.lag, "0 to 8");
    }
    let is_axis = matches!(term.of, Regressor::Lagged | Regressor::Smoothed);
    if term.of == Regressor::Smoothed && term.lag >= SMOOTHING_S.len() {
        return refuse(
            format!("{key}.lag"),
            term.lag,
            "the place of a time constant, 0 or 1",
        );
    }
    if is_axis && term.index >= axes {
        let key = format!("{key}.index");
        return refuse(key, term.index, "the index of an axis, from 0");
    }
    if term.index >= DRIVES_MAX {
        return refuse(
            format!("{key}.index"),
            term.index,
            "the index of a drive, 0 to 7",
        );
    }
    let beyond = term.powers.iter().skip(axes).any(|&power| power > 0);
    let order: u32 = term.powers.iter().map(|&power| u32::from(power)).sum();
    if beyond || order > ORDER_MAX {
        let (key, found) = (format!("{key}.powers"), format!("{:?}", term.powers));
        return refuse(key, found, "powers of the axes, their sum at most 4");
    }
    Ok(())
}
