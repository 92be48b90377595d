//! Every form of the grammar, each against the same model written out.

use vigil_pomdp::Pomdp;

const HEAD: &str = "discount: 0.9 states: a b actions: go stay observations: x y\n";
/// T and O for models whose R is of interest.
const BODY: &str = "T: * uniform O: * uniform\n";

fn model(text: &str) -> Pomdp {
    Pomdp::parse(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[test]
fn each_form_means_what_it_means_written_out() {
    let out = "T: go : a : a 0.25 T: go : a : b 0.75 T: go : b : b 1 T: stay : a : a 1\n\
        T: stay : b : b 1\n";
    let forms = [
        "T: go 0.25 0.75 0 1 T: stay identity",
        "T: go : a 0.25 0.75 T: go : b 0 1. T: stay : * : * 0 T: stay : a : a 1 T:stay:b:b 1",
        "T: 0 : 0 .25 7.5e-1 T: 0:1:1 1 T: 1 identity",
        "T: * identity T: go : a\n0.25 # a quarter\n0.75",
        "T: * : b identity2",
        "T: * : * uniform T: * identity T: go : a : a 0.25 T: go : a : b 0.75",
    ];
    for form in forms {
        let text = format!("{HEAD}{form} O: * uniform");
        if form.contains("identity2") {
            assert!(Pomdp::parse(&text).is_err());
            continue;
        }
        assert_eq!(
            model(&text),
            model(&format!("{HEAD}{out} O: * uniform")),
            "{form}"
        );
    }
    let observations = [
        "O: * 0.5 0.5 0.125 0.875",
        "O: * : a uniform O: * : b 0.125 0.875",
        "O: * : * : * 0.5 O: * : b : x 0.125 O: * : 1 : 1 0.875",
        "O: go uniform O: stay uniform O: * : b 0.125 0.875",
    ];
    let all = observations.map(|form| model(&format!("{HEAD}{out}{form}")));
    assert!(all.iter().all(|one| *one == all[0]));
    assert_eq!(all[0].likelihood(1, 0), [0.5, 0.125]);
}

#[test]
fn the_start_belief_has_every_form() {
    let of = |start: &str| {
        let text = format!("discount: 1 states: a b c actions: 1 {start} T: 0 identity");
        model(&text).start().to_vec()
    };
    let third = 1.0 / 3.0;
    assert_eq!(of(""), [third; 3]);
    assert_eq!(of("start: uniform"), [third; 3]);
    assert_eq!(of("start: b"), [0.0, 1.0, 0.0]);
    assert_eq!(of("start: 2"), [0.0, 0.0, 1.0]);
    assert_eq!(of("start: 0.25 0.25 0.5"), [0.25, 0.25, 0.5]);
    assert_eq!(of("start: 0 1 0"), [0.0, 1.0, 0.0]);
    assert_eq!(of("start include: a 2"), [0.5, 0.0, 0.5]);
    assert_eq!(of("start exclude: a"), [0.0, 0.5, 0.5]);
    let reset = "discount: 1 states: a b actions: go start: 0.25 0.75 T: go : * reset";
    assert_eq!(model(reset).successors(1, 0), [(0, 0.25), (1, 0.75)]);
}

#[test]
fn rewards_by_outcome_are_kept_and_later_ones_win() {
    let of = |rules: &str| model(&format!("{HEAD}{BODY}{rules}"));
    let all = |model: &Pomdp| -> Vec<f64> {
        let outcomes = (0..16).map(|i| (i / 8, i / 4 % 2, i / 2 % 2, i % 2));
        outcomes
            .map(|(a, s, to, z)| model.reward_of(s, a, to, z))
            .collect()
    };
    let blocks = of("R: go : a 1 2 3 4 R: go : b : a 5 -6 R: stay : * : b : y 7");
    let wanted = [
        1., 2., 3., 4., 5., -6., 0., 0., 0., 0., 0., 7., 0., 0., 0., 7.,
    ];
    assert_eq!(all(&blocks), wanted);
    assert_eq!(blocks.reward(0, 0), 2.5);
    assert!(blocks.has_outcome_rewards());
    let later =
        of("R: stay : a : a : x 9 R: go : b : a : * 3 R: * : * : * : * 2 R: 1 : 0 : 1 : 0 5");
    let mut wanted = [2.0; 16];
    wanted[10] = 5.0;
    assert_eq!(all(&later), wanted);
    // Costs are negative rewards, never a negative zero, and mean something else than rewards.
    let cost = |values: &str| {
        let head = HEAD.replace("discount: 0.9", &format!("discount: 0.9 values: {values}"));
        model(&format!("{head}{BODY}R: go : * : * : * 3"))
    };
    let (as_cost, as_reward) = (cost("cost"), cost("reward"));
    assert_eq!((as_cost.reward(0, 0), as_cost.is_cost()), (-3.0, true));
    assert!(as_cost.reward(0, 1).is_sign_positive());
    assert_ne!(as_cost.hash(), as_reward.hash());
    let negative = model(&format!("{HEAD}{BODY}R: go : * : * : * -3"));
    assert_eq!(as_cost.hash(), negative.hash());
}

#[test]
fn models_without_observations_are_read() {
    let text = "discount: 0.9 states: a b actions: go stay T: * identity\n\
        R: go 1 2 3 4 R: stay : a : b 5 R: stay : b 6 7 R: stay : a : a : * 8";
    let mdp = model(text);
    assert!(mdp.is_mdp());
    assert_eq!(mdp.observations(), ["none"]);
    assert_eq!(mdp.likelihood(1, 0), [1.0, 1.0]);
    let got = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(s, a)| mdp.reward(s, a));
    assert_eq!(got, [1.0, 4.0, 8.0, 7.0]);
    assert_eq!(mdp.reward_of(0, 1, 1, 0), 5.0);
    assert_eq!(mdp, model(&mdp.to_cassandra()));
    assert!(!mdp.to_cassandra().contains("observations"));
    let error = Pomdp::parse(&text.replace("R: go", "O: go uniform R: go")).unwrap_err();
    assert!(error.message.contains("no O"));
    // With observations, a matrix over s and s' alone is refused.
    assert!(Pomdp::parse(&format!("{HEAD}{BODY}R: go 1 2 3 4")).is_err());
}

#[test]
fn line_ends_and_marks_of_other_systems_are_read() {
    let text = format!("{HEAD}# comment\n{BODY}# more\nR: go : * : * : * 1\n");
    let unix = model(&text);
    assert_eq!(unix, model(&text.replace('\n', "\r\n")));
    assert_eq!(unix, model(&text.replace('\n', "\r")));
    assert_eq!(unix, model(&format!("\u{feff}{text}")));
    for end in ["\n", "\r\n", "\r"] {
        let broken = text.replace("R: go", "R: gone").replace('\n', end);
        assert_eq!(Pomdp::parse(&broken).unwrap_err().at.line, 5);
    }
}

#[test]
fn greedy_texts_are_refused_by_a_limit() {
    let cases = [
        (
            "discount: 1 states: 1000000 actions: 1",
            "1000000 names, allowed are 1 to 100000",
        ),
        (
            "discount: 1 states: 99999999999999999999999 actions: 1",
            "not a number of names",
        ),
        (
            "discount: 1 states: 100000 actions: 100000",
            "allowed are 4194304",
        ),
        (
            "discount: 1 states: 100000 actions: 40 observations: 1000",
            "allowed are 16777216",
        ),
        (
            "discount: 1 states: 100000 actions: 1 T: 0 uniform",
            "allowed are 67108864",
        ),
        (
            "discount: 1 states: 100000 actions: 1 T: 0 : * reset",
            "allowed are 67108864",
        ),
        (
            "discount: 1 states: 8000 actions: 1 T: 0 uniform",
            "16784000, allowed are 16777216",
        ),
        (
            "discount: 1 states: 9000 actions: 1 observations: 1000 T: 0 identity O: 0 uniform\n\
             R: * : * : 3 : * 1",
            "allowed are 67108864",
        ),
    ];
    for (text, part) in cases {
        let message = Pomdp::parse(text).unwrap_err().to_string();
        assert!(message.contains(part), "{part}: {message}");
    }
    // Large and sparse is no trouble.
    let large = "discount: 0.9 states: 100000 actions: 2 T: * identity R: * : * : * 1";
    let large = model(large);
    assert_eq!(large.successors(99_999, 1), [(99_999, 1.0)]);
    assert_eq!(large.reward(5, 1), 1.0);
}
