//! The model of exceptions of navigation and hardware: what follows from its parameters.

use vigil_missions::exceptions::{ParameterError, Parameters, fit, generate};
use vigil_missions::learning::Record;
use vigil_pomdp::Pomdp;

const SHIPPED: &str = include_str!("../../../../config/corridor.recovery.toml");

/// A way that may be blocked, a wheel that may be stuck, one or both at once.
const SMALL: &str = r#"
model = "exceptions"
discount = 0.9
at_once_max = 2
symptoms = [["EPS", "EPM"], ["LD"]]
nominal = { symptoms = { EPM = 0.1 }, outcomes = { BO = 0.8 } }
[[action]]
name = "FP"
follows = true
speed_scale = 1.0
[[action]]
name = "CP"
follows = true
speed_scale = 0.5
remedies = ["STUCK"]
needless_price = 3.0
[[action]]
name = "GO"
price = 0.5
reports = ["BO"]
[[action]]
name = "GU"
price = 9.0
ends = true
[[exception]]
name = "NNP"
kind = "way"
arises = 0.2
passes = 0.1
mended = { GO = 0.5 }
turns = { GO = { DE = 0.25 } }
follow = -1.0
symptoms = { EPS = 0.2, EPM = 0.3 }
outcomes = { BO = 0.05 }
[[exception]]
name = "DE"
kind = "way"
follow = -1.0
[[exception]]
name = "STUCK"
kind = "hardware"
arises = 0.1
price = 4.0
remedied_price = 0.4
symptoms = { EPM = 0.5, LD = 0.5 }
"#;

fn model(text: &str) -> Result<Pomdp, ParameterError> {
    let parameters: Parameters = toml::from_str(text).unwrap();
    Ok(Pomdp::parse(&generate(&parameters)?).unwrap())
}

/// What `text` holds of the model, by names.
struct Named(Pomdp);

impl Named {
    fn small() -> Self {
        Self(model(SMALL).unwrap())
    }

    fn index(names: &[String], name: &str) -> usize {
        names.iter().position(|n| n == name).unwrap()
    }

    fn t(&self, state: &str, action: &str, next: &str) -> f64 {
        let [state, next] = [state, next].map(|name| Self::index(self.0.states(), name));
        let action = Self::index(self.0.actions(), action);
        let row = self.0.successors(state, action);
        row.iter()
            .find(|(to, _)| *to == next)
            .map_or(0.0, |(_, p)| *p)
    }

    fn o(&self, action: &str, next: &str, observation: &str) -> f64 {
        let z = Self::index(self.0.observations(), observation);
        let action = Self::index(self.0.actions(), action);
        self.0.likelihood(action, z)[Self::index(self.0.states(), next)]
    }

    fn r(&self, state: &str, action: &str) -> f64 {
        let action = Self::index(self.0.actions(), action);
        self.0.reward(Self::index(self.0.states(), state), action)
    }
}

fn assert_near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-12, "{found} {expected}");
}

#[test]
fn the_shipped_file_is_what_its_parameters_generate() {
    let text = generate(&toml::from_str(SHIPPED).unwrap()).unwrap();
    assert!(
        text == include_str!("../../../../config/corridor.pomdp"),
        "run: vigil pomdp generate config/corridor.recovery.toml --out config/corridor.pomdp"
    );
    let model = Pomdp::parse(&text).unwrap();
    assert_eq!(model.warnings(), []);
    assert!(model.states().len() <= 64 && model.actions().len() <= 32);
}

#[test]
fn states_are_sets_and_observations_are_sets() {
    let small = Named::small();
    let states = ["NOM", "STUCK", "NNP", "DE", "NNP-STUCK", "DE-STUCK"];
    assert_eq!(small.0.states(), states);
    assert_eq!(small.0.observations().len(), 12);
    let one = model(&SMALL.replace("at_once_max = 2", "at_once_max = 1")).unwrap();
    assert_eq!(one.states(), &states[..4]);
}

#[test]
fn kinds_come_and_go_independently() {
    let small = Named::small();
    for (next, p) in [
        ("NOM", 0.72),
        ("NNP", 0.18),
        ("STUCK", 0.08),
        ("NNP-STUCK", 0.02),
    ] {
        assert_near(small.t("NOM", "FP", next), p);
        assert_near(small.t("DE-STUCK", "GU", next), p);
    }
    // 0.45 stays: a quarter of it finds that no way leads round.
    for (next, p) in [("NOM", 0.55), ("NNP", 0.3375), ("DE", 0.1125)] {
        assert_near(small.t("NNP", "GO", next), 0.9 * p);
        let with = match next {
            "NOM" => "STUCK".to_owned(),
            way => format!("{way}-STUCK"),
        };
        assert_near(small.t("NNP", "GO", &with), 0.1 * p);
        assert_near(small.t("NNP-STUCK", "GO", &with), p);
    }
    // What there is no room for does not arise.
    let one = Named(model(&SMALL.replace("at_once_max = 2", "at_once_max = 1")).unwrap());
    assert_near(one.t("STUCK", "FP", "STUCK"), 1.0);
    assert_near(one.t("NNP", "FP", "NNP"), 0.9);
    assert_near(one.t("NNP", "FP", "NOM"), 0.09);
    assert_near(one.t("NNP", "FP", "STUCK"), 0.01);
}

#[test]
fn what_lasts_a_part_of_a_step_gives_a_part_of_its_time_and_of_its_signs() {
    let text = SMALL.replace("price = 0.5\n", "price = 0.5\nlasts = 0.5\nshows = 0.5\n");
    let short = Named(model(&text).unwrap());
    // Nothing of two kinds arises in half a step: the roots of 0.8 and of 0.9.
    assert_near(short.t("NOM", "GO", "NOM"), (0.8 * 0.9_f64).sqrt());
    assert_near(short.t("NOM", "FP", "NOM"), 0.8 * 0.9);
    let stays = 0.5 * 0.9_f64.sqrt();
    assert_near(short.t("NNP-STUCK", "GO", "NNP-STUCK"), stays * 0.75);
    assert_near(short.t("NNP-STUCK", "GO", "DE-STUCK"), stays * 0.25);
    assert_near(short.o("GO", "NNP", "EPS"), 0.5 * 0.2 * 0.95);
    assert_near(short.o("FP", "NNP", "EPS"), 0.2);
    for wrong in ["lasts = 0.0", "lasts = 101.0", "shows = 1.5"] {
        let text = SMALL.replace("price = 0.5\n", &format!("price = 0.5\n{wrong}\n"));
        assert!(model(&text).is_err(), "{wrong}");
    }
}

#[test]
fn a_task_ends_where_the_robot_follows_its_path_and_the_next_begins() {
    let text = SMALL.replace("discount = 0.9", "discount = 0.9\ntask_steps = 4.0");
    let short = Named(model(&text).unwrap());
    // A quarter of the tasks end; the next begins with what may just have arisen.
    assert_near(short.t("STUCK", "FP", "STUCK"), 0.75 * 0.8 + 0.25 * 0.08);
    assert_near(short.t("STUCK", "FP", "NOM"), 0.25 * 0.72);
    assert_near(short.t("STUCK", "CP", "NOM"), 0.125 * 0.72);
    // Nobody drives before what blocks the way, nor while looking.
    assert_near(short.t("NNP", "FP", "NNP"), 0.9 * 0.9);
    assert_near(short.t("STUCK", "GO", "NOM"), 0.0);
    let wrong = SMALL.replace("discount = 0.9", "discount = 0.9\ntask_steps = 0.5");
    assert!(model(&wrong).is_err());
}

#[test]
fn chances_are_counted_where_states_are_known() {
    let parameters: Parameters = toml::from_str(SMALL).unwrap();
    let small = Named::small();
    let of = |names: &[String], name: &str| Named::index(names, name) as u32;
    let record = |steps: &[(&str, &str)], states: &[Option<&str>]| Record {
        actions: steps.iter().map(|s| of(small.0.actions(), s.0)).collect(),
        observations: steps
            .iter()
            .map(|s| of(small.0.observations(), s.1))
            .collect(),
        rewards: Vec::new(),
        labels: states
            .iter()
            .map(|s| s.map(|s| of(small.0.states(), s)))
            .collect(),
    };
    let records = [
        // A blocked way arises in one of four steps; it is mended in one of two looks, and found
        // without another way in the other.
        record(
            &[("FP", "none"), ("FP", "EPM"), ("GO", "BO")],
            &[Some("NOM"), Some("NOM"), Some("NNP"), Some("NOM")],
        ),
        record(
            &[("FP", "none"), ("FP", "none"), ("GO", "none")],
            &[Some("NOM"), Some("NOM"), None, Some("NOM")],
        ),
        record(
            &[("FP", "none"), ("GO", "EPS")],
            &[Some("NOM"), Some("NNP"), Some("DE")],
        ),
    ];
    let chance = |weight: f64, key: &str| {
        let found = fit(&parameters, &small.0, &records, weight);
        let chance = found.chances.iter().find(|chance| chance.key == key);
        chance.map(|chance| (chance.count, chance.visits, chance.fitted))
    };
    assert_eq!(fit(&parameters, &small.0, &records, 1.0).steps, 6);
    assert_eq!(chance(0.0, "NNP: arises"), Some((2.0, 4.0, 0.5)));
    // By hand 0.2, worth six visits.
    assert_eq!(
        chance(6.0, "NNP: arises"),
        Some((2.0, 4.0, (2.0 + 1.2) / 10.0))
    );
    // One of two is gone; of the 1.8 that did not pass by themselves 0.8 were mended.
    let (k, n, p) = chance(0.0, "NNP: mended by GO").unwrap();
    assert_near(k, 0.8);
    assert_near(n, 1.8);
    assert_near(p, 0.8 / 1.8);
    assert_eq!(
        chance(0.0, "NNP: turned into DE by GO"),
        Some((1.0, 1.0, 1.0))
    );
    assert_eq!(chance(0.0, "nominal: outcome BO"), Some((1.0, 1.0, 1.0)));
    assert_eq!(chance(0.0, "NNP: symptom EPM"), Some((1.0, 2.0, 0.5)));
    // What is ruled out stays so, and what was never visited too.
    assert_eq!(chance(0.0, "DE: arises"), None);
    assert_eq!(chance(0.0, "STUCK: symptom LD"), None);
}

#[test]
fn each_exception_shows_its_own_and_what_is_remedied_shows_nothing() {
    let small = Named::small();
    assert_near(small.o("FP", "NOM", "EPM"), 0.1);
    assert_near(small.o("FP", "NNP", "EPS"), 0.2);
    // Neither shows in 0.5 of 0.5; EPM has 0.8 of what either shows.
    assert_near(small.o("FP", "NNP-STUCK", "none"), 0.25 * 0.5);
    assert_near(small.o("FP", "NNP-STUCK", "EPM"), 0.75 * 0.8 * 0.5);
    assert_near(small.o("FP", "NNP-STUCK", "EPS_LD"), 0.75 * 0.2 * 0.5);
    assert_near(small.o("CP", "NNP-STUCK", "EPS"), 0.2);
    assert_near(small.o("CP", "STUCK", "EPM"), 0.1);
    // Outcomes answer their action.
    assert_near(small.o("GO", "NOM", "BO"), 0.9 * 0.8);
    assert_near(small.o("GO", "NNP", "BO"), 0.5 * 0.05);
    assert_near(small.o("GO", "STUCK", "EPM_LD_BO"), 0.5 * 0.5 * 0.8);
    assert_near(small.o("FP", "NOM", "BO"), 0.0);
}

#[test]
fn following_earns_and_faults_cost_by_speed() {
    let small = Named::small();
    for (state, action, reward) in [
        ("NOM", "FP", 1.0),
        ("NOM", "CP", 0.5 - 3.0),
        ("STUCK", "FP", 1.0 - 4.0),
        ("STUCK", "CP", 0.5 - 0.5 * 0.4),
        ("NNP", "FP", -1.0),
        ("NNP-STUCK", "CP", -1.0 - 0.2),
        ("NNP-STUCK", "GO", -0.5),
        ("DE", "GU", -9.0),
    ] {
        assert_near(small.r(state, action), reward);
    }
}

#[test]
fn what_means_nothing_is_named() {
    for (from, to, part) in [
        (
            "discount = 0.9",
            "discount = 1.0",
            "discount: 1 is out of range",
        ),
        ("at_once_max = 2", "at_once_max = 0", "at_once_max"),
        (
            "follows = true",
            "follows = false",
            "an action that follows the path",
        ),
        (
            "remedies = [\"STUCK\"]",
            "remedies = [\"HP\"]",
            "there is no 'HP'",
        ),
        (
            "mended = { GO = 0.5 }",
            "mended = { XX = 0.5 }",
            "mended: there is no 'XX'",
        ),
        (
            "mended = { GO = 0.5 }",
            "mended = { GO = 1.5 }",
            "mended: 1.5 is out of range",
        ),
        (
            "GO = { DE = 0.25 }",
            "GO = { STUCK = 0.25 }",
            "turns: there is no 'STUCK'",
        ),
        (
            "GO = { DE = 0.25 }",
            "GO = { DE = 0.7, NNP = 0.7 }",
            "turns: the chances add up",
        ),
        (
            "EPS = 0.2, EPM = 0.3",
            "EPS = 0.8, EPM = 0.3",
            "symptoms: the chances add up",
        ),
        (
            "EPS = 0.2, EPM = 0.3",
            "XYZ = 0.8",
            "symptoms: there is no 'XYZ'",
        ),
        (
            "arises = 0.2",
            "arises = 1.2",
            "arises: 1.2 is out of range",
        ),
        ("price = 4.0", "price = -4.0", "price: -4 is out of range"),
        ("name = \"DE\"", "name = \"NNP\"", "NNP"),
    ] {
        assert!(SMALL.contains(from), "{from}");
        let error = model(&SMALL.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
}
