//! Rewards of the heuristics on the public models, from an independent implementation.

/// Heuristics, in the order of the columns of [`HEURISTICS`].
pub const POLICIES: [&str; 10] = [
    "mls", "av", "qmdp", "fib", "dm-mls", "adm-mls", "dm-av", "adm-av", "dm-qmdp", "adm-qmdp",
];

/// Model, means of another implementation (3,000 episodes, K = 0.5, horizon where the discount's
/// power falls below 1e-4), and the largest 95 % half-width of MLS and AV, of ADM, of the rest.
pub type Row = (&'static str, [f64; 10], [f64; 3]);
/// Discounted reward of the heuristics.
pub const HEURISTICS: [Row; 13] = [
    (
        "tiger.95",
        [
            -900.6, -899.2, 19.91, 19.91, 19.91, -75.4, 19.91, -75.4, 19.91, 19.91,
        ],
        [6.4, 3.2, 1.0],
    ),
    (
        "tiger.aaai",
        [
            -179.6, -180.3, 1.96, 1.96, 1.96, -14.4, 1.96, -14.4, 1.96, 1.96,
        ],
        [3.0, 1.3, 0.4],
    ),
    (
        "1d",
        [
            1.265, 1.187, 1.265, 1.265, 1.112, 0.977, 1.112, 0.977, 1.112, 0.977,
        ],
        [0.016; 3],
    ),
    (
        "1d.noisy",
        [
            1.149, 1.237, 1.237, 1.237, 1.069, 1.070, 1.069, 1.070, 1.069, 1.070,
        ],
        [0.013; 3],
    ),
    (
        "4x3.95",
        [
            1.794, 1.788, 1.910, 1.920, 1.772, 1.772, 1.765, 1.765, 1.772, 1.824,
        ],
        [0.035; 3],
    ),
    (
        "cheese.95",
        [
            3.398, 3.486, 3.486, 3.486, 3.486, 3.486, 3.486, 3.486, 3.486, 3.486,
        ],
        [0.012; 3],
    ),
    (
        "mini-hall2",
        [
            0.327, 2.612, 0.327, 0.328, 0.500, 2.672, 2.643, 2.672, 0.500, 2.672,
        ],
        [0.021; 3],
    ),
    (
        "network",
        [
            41.7, 63.5, 242.5, 245.0, -599.0, -226.0, -599.0, -226.0, -599.0, -226.0,
        ],
        [6.1; 3],
    ),
    (
        "paint95-zmdp",
        [
            8.81, 8.81, 20.01, 20.01, 8.81, 8.81, 8.81, 8.81, 20.01, 20.01,
        ],
        [0.12; 3],
    ),
    ("shuttle95-zmdp", [33.02; 10], [0.17; 3]),
    (
        "web-ad",
        [
            0.801, 0.801, 0.804, 0.804, 0.743, 0.737, 0.743, 0.737, 0.743, 0.737,
        ],
        [0.0008; 3],
    ),
    (
        "tiger-grid",
        [
            0.942, 0.939, 0.234, 0.233, 0.948, 0.974, 0.935, 0.959, 0.240, 0.411,
        ],
        [0.058; 3],
    ),
    (
        "hallway",
        [
            0.820, 0.781, 0.334, 0.236, 0.792, 0.852, 0.770, 0.821, 0.466, 0.500,
        ],
        [0.019; 3],
    ),
];

/// Half-width of the interval of one policy's mean, of those of its row.
#[must_use]
pub fn half_width(policy: &str, half_widths: [f64; 3]) -> f64 {
    half_widths[match policy {
        "mls" | "av" => 0,
        "adm-mls" | "adm-av" => 1,
        _ => 2,
    }]
}
