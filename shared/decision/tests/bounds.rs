//! Bounds against the reference values of public models, and against each other.

#![allow(clippy::unwrap_used, missing_docs)]

use std::path::PathBuf;

use vigil_decision::bounds::{SolveError, blind, fib, mdp, tib};
use vigil_decision::{Budget, Pomdp};

/// File, then blind, TIB (NaN: not known), FIB, Q-MDP and MDP at the start belief, from an
/// independent implementation.
const REFERENCE: [(&str, [f64; 5]); 16] = [
    (
        "1d",
        [
            0.8139536485,
            1.27586204,
            1.470588076,
            1.645160907,
            1.77419314,
        ],
    ),
    (
        "1d.noisy",
        [
            1.028431231,
            1.30499736,
            1.458569769,
            1.574792237,
            1.716450418,
        ],
    ),
    (
        "4x3.95",
        [
            -0.5890765766,
            1.98746019,
            2.111884788,
            2.333007176,
            2.481436388,
        ],
    ),
    (
        "cheese.95",
        [
            0.2366468955,
            3.48620683,
            3.521566602,
            3.789942296,
            3.936065404,
        ],
    ),
    (
        "mini-hall2",
        [
            0.09010999547,
            3.07595672,
            3.451907274,
            3.667862455,
            3.860907153,
        ],
    ),
    (
        "network",
        [
            -125.4383991,
            274.357052,
            335.2214651,
            430.423085,
            452.0047455,
        ],
    ),
    ("paint95-zmdp", [20.0, 20.0, 20.0, 25.23188406, 25.50724638]),
    (
        "shuttle95-zmdp",
        [0.0, 32.8897247, 32.88972469, 32.88972469, 32.88972469],
    ),
    ("tiger.95", [-20.0, 49.6056091, 87.17948718, 189.0, 200.0]),
    ("tiger.aaai", [-4.0, 6.70270272, 14.85714286, 29.0, 40.0]),
    (
        "tiger-grid",
        [0.0, 2.57615218, 2.732547522, 2.981835992, 2.981835992],
    ),
    (
        "hallway",
        [
            0.04723632953,
            1.18764333,
            1.289371242,
            1.4589848,
            1.535773008,
        ],
    ),
    (
        "web-ad",
        [
            0.7777013087,
            0.810465486,
            0.8175079105,
            0.8305732484,
            0.8305732484,
        ],
    ),
    (
        "machine",
        [37.46659856, f64::NAN, 645.9791929, 661.8560507, 661.8560507],
    ),
    (
        "bridge-repair",
        [
            -25860843.4,
            f64::NAN,
            -24180693.17,
            -22484339.7,
            -22484314.05,
        ],
    ),
    (
        "cheng.D3-5",
        [867555.5421, f64::NAN, 871658.9854, 905818.2026, 905820.1449],
    ),
];

/// Blind, TIB, FIB, Q-MDP, MDP at the start belief; TIB is NaN where its tables are too large.
fn all(model: &Pomdp) -> [f64; 5] {
    let mut never = || false;
    let mut budget = Budget::new(&mut never);
    let b0 = model.start();
    let relaxed = mdp::solve_within(model, &mut budget).unwrap();
    let fast = fib::solve_from(model, &relaxed, &mut budget).unwrap();
    let tighter = match tib::solve_from(model, &fast, &mut budget) {
        Ok(tib) => tib.value(b0),
        Err(SolveError::Entries(_)) => f64::NAN,
        Err(error) => unreachable!("{error}"),
    };
    let qmdp = (0..model.actions().len())
        .map(|a| b0.iter().zip(relaxed.q_of(a)).map(|(b, q)| b * q).sum())
        .fold(f64::NEG_INFINITY, f64::max);
    let v_mdp = b0
        .iter()
        .enumerate()
        .map(|(s, b)| b * relaxed.value(s))
        .sum();
    let lower = blind::solve(model, &mut budget).unwrap().value(b0);
    [lower, tighter, fast.value(b0), qmdp, v_mdp]
}

fn read(data: &std::ffi::OsStr, name: &str) -> Pomdp {
    let folder = PathBuf::from(data).join("pomdp");
    let text = std::fs::read_to_string(folder.join(format!("{name}.pomdp"))).unwrap();
    Pomdp::parse(&text).unwrap()
}

#[test]
fn public_models_have_their_reference_bounds() {
    let Some(data) = std::env::var_os("VIGIL_DATA") else {
        eprintln!("SKIPPED: VIGIL_DATA is not set; public POMDP files are not read");
        return;
    };
    for (name, wanted) in REFERENCE {
        let got = all(&read(&data, name));
        for ((got, want), what) in got
            .iter()
            .zip(wanted)
            .zip(["blind", "TIB", "FIB", "QMDP", "MDP"])
        {
            let is_close = want.is_nan() || (got - want).abs() <= 1e-6 * want.abs() + 1e-12;
            assert!(is_close, "{name}, {what}: {got}, reference {want}");
        }
        for pair in got
            .windows(2)
            .filter(|pair| !pair[0].is_nan() && !pair[1].is_nan())
        {
            assert!(pair[0] <= pair[1] + 1e-9 * pair[1].abs(), "{name}: {got:?}");
        }
    }
}
