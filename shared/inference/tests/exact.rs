//! The exact filters against independently computed beliefs (tests/data/filters).
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::PathBuf;

use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use vigil_inference::forward::Forward;
use vigil_inference::gaussian::Gaussian;
use vigil_inference::logspace::log_normal;

fn read(name: &str) -> Value {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/filters");
    serde_json::from_str(&std::fs::read_to_string(root.join(name)).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

fn rows(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().unwrap().iter().map(numbers).collect()
}

fn matrix(value: &Value) -> Matrix3<f64> {
    let rows = rows(value);
    Matrix3::from_fn(|i, j| rows[i][j])
}

#[test]
fn thirteen_modes_are_filtered_exactly() {
    let case = read("case1_hmm13.json");
    let (transition, means, sigma) = (rows(&case["P"]), rows(&case["M"]), case["sigma"].as_f64());
    let variance = sigma.unwrap() * sigma.unwrap();
    let transition: [[f64; 13]; 13] =
        std::array::from_fn(|i| std::array::from_fn(|j| transition[i][j]));
    let (expected, log_likelihood) = (rows(&case["filter"]), numbers(&case["loglik"]));
    let (mut filter, mut sum) = (Forward::<13>::at(0), 0.0);
    for (t, observation) in rows(&case["obs"]).iter().enumerate() {
        filter.predict(&transition);
        let log_l = std::array::from_fn(|k| {
            let apart = observation.iter().zip(&means[k]).map(|(z, mean)| z - mean);
            apart.map(|residual| log_normal(residual, variance)).sum()
        });
        sum += filter.update(&log_l).unwrap();
        for (found, expected) in filter.log_p().iter().zip(&expected[t]) {
            assert!((found.exp() - expected).abs() < 1e-9, "step {t}");
        }
        assert!(
            (sum - log_likelihood[t]).abs() < 1e-9 * (1.0 + sum.abs()),
            "step {t}"
        );
    }
}

#[test]
fn a_linear_gaussian_state_is_filtered_exactly() {
    let case = read("case2_lgss3.json");
    let vector = |name: &str| Vector3::from_column_slice(&numbers(&case[name]));
    let (a, b) = (matrix(&case["A"]), vector("b"));
    let (q, r) = (matrix(&case["Q"]), matrix(&case["R"]));
    let mut state = Gaussian {
        mean: vector("m0"),
        covariance: matrix(&case["C0"]),
    };
    let (means, covariances) = (rows(&case["mean"]), case["cov"].as_array().unwrap());
    let (log_likelihood, mut sum) = (numbers(&case["loglik"]), 0.0);
    for (t, observation) in rows(&case["obs"]).iter().enumerate() {
        state.predict(&a, &b, &q);
        let innovation = Vector3::from_column_slice(observation) - state.mean;
        sum += state.update(&innovation, &Matrix3::identity(), &r).unwrap();
        let mean = Vector3::from_column_slice(&means[t]);
        assert!((state.mean - mean).abs().max() < 1e-9, "step {t}");
        assert!(
            (state.covariance - matrix(&covariances[t])).abs().max() < 1e-9,
            "step {t}"
        );
        assert!(
            (sum - log_likelihood[t]).abs() < 1e-9 * (1.0 + sum.abs()),
            "step {t}"
        );
    }
}
