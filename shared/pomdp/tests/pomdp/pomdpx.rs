//! `.pomdpx`: against the same model written in Cassandra's format, and by hand.

use proptest::prelude::*;
use vigil_pomdp::Pomdp;

fn document(variables: &str, functions: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n<pomdpx version=\"0.1\" id=\"test\">\n\
         <Description>invented</Description>\n<Discount>0.95</Discount>\n\
         <Variable>{variables}</Variable>\n{functions}\n</pomdpx>\n"
    )
}

fn conditional(variable: &str, parents: &str, entries: &[(&str, &str)]) -> String {
    let entries = entries.iter().map(|(instance, numbers)| {
        format!("<Entry><Instance>{instance}</Instance><ProbTable>{numbers}</ProbTable></Entry>\n")
    });
    format!(
        "<CondProb><Var>{variable}</Var><Parent>{parents}</Parent><Parameter type=\"TBL\">\n{}\
         </Parameter></CondProb>\n",
        entries.collect::<String>()
    )
}

fn reward(parents: &str, entries: &[(&str, &str)]) -> String {
    conditional("r", parents, entries)
        .replace("CondProb", "Func")
        .replace("ProbTable", "ValueTable")
}

const TIGER_VARIABLES: &str = "
<StateVar vnamePrev=\"s0\" vnameCurr=\"s1\"><ValueEnum>left right</ValueEnum></StateVar>
<ActionVar vname=\"a\"><ValueEnum>listen open-left open-right</ValueEnum></ActionVar>
<ObsVar vname=\"z\"><ValueEnum>hear-left hear-right</ValueEnum></ObsVar>
<RewardVar vname=\"r\"/>";

fn tiger() -> String {
    let transition = [("* - -", "uniform"), ("listen - -", "identity")];
    let heard = [
        ("* * -", "0.5 0.5"),
        ("listen - -", "0.85 0.15 <!-- mirrored --> 0.15 0.85"),
    ];
    let values = [
        ("listen *", "-1"),
        ("open-left -", "-100 10"),
        ("open-right left", "10"),
        ("open-right right", "-1e2"),
    ];
    let functions = [
        format!(
            "<InitialStateBelief>{}</InitialStateBelief>",
            conditional("s0", "null", &[("-", "uniform")])
        ),
        format!(
            "<StateTransitionFunction>{}</StateTransitionFunction>",
            conditional("s1", "a s0", &transition)
        ),
        format!(
            "<ObsFunction>{}</ObsFunction>",
            conditional("z", "a s1", &heard)
        ),
        format!(
            "<RewardFunction>{}</RewardFunction>",
            reward("a s0", &values)
        ),
    ];
    document(TIGER_VARIABLES, &functions.join("\n"))
}

#[test]
fn the_tiger_is_the_same_in_both_formats() {
    let cassandra = "discount: 0.95 values: reward states: left right\n\
        actions: listen open-left open-right observations: hear-left hear-right\n\
        T: * uniform T: listen identity O: * uniform O: listen 0.85 0.15 0.15 0.85\n\
        R: listen : * : * : * -1 R: open-left : left : * : * -100\n\
        R: open-left : right : * : * 10 R: open-right : left : * : * 10\n\
        R: open-right : right : * : * -100";
    let model = Pomdp::parse_pomdpx(&tiger()).unwrap();
    assert_eq!(model, Pomdp::parse(cassandra).unwrap());
    assert_eq!(model, Pomdp::parse(&model.to_cassandra()).unwrap());
    assert!(model.warnings().is_empty());
}

/// A door that is seen, a charge that is not; the charge's fate depends on the door's next state.
fn factored() -> String {
    let variables = "
<StateVar vnamePrev=\"door0\" vnameCurr=\"door1\" fullyObs=\"true\">
  <ValueEnum>open shut</ValueEnum></StateVar>
<StateVar vnamePrev=\"charge0\" vnameCurr=\"charge1\"><NumValues>3</NumValues></StateVar>
<ActionVar vname=\"act\"><ValueEnum>go 2nd</ValueEnum></ActionVar>
<ObsVar vname=\"lamp\"><ValueEnum>on off</ValueEnum></ObsVar>
<RewardVar vname=\"r\"/><RewardVar vname=\"q\"/>";
    let functions = format!(
        "<InitialStateBelief>{}{}</InitialStateBelief>
<StateTransitionFunction>{}{}</StateTransitionFunction>
<ObsFunction>{}</ObsFunction>
<RewardFunction>{}{}</RewardFunction>",
        conditional(
            "charge0",
            "door0",
            &[("open -", "1 0 0"), ("shut -", "0 0.5 0.5")]
        ),
        conditional("door0", "null", &[("-", "0.25 0.75")]),
        // The charge comes first in the file, and depends on the door after the step.
        conditional(
            "charge1",
            "door1 charge0",
            &[("* - -", "identity"), ("shut s0 -", "0 0.125 0.875")]
        ),
        conditional(
            "door1",
            "act door0",
            &[
                ("* * -", "0.5 0.5"),
                ("go open open", "1"),
                ("go open shut", "0")
            ]
        ),
        conditional("lamp", "charge1", &[("* -", "0 1"), ("s0 -", "0.75 0.25")]),
        reward("act charge0", &[("* *", "-1"), ("2nd s2", "4")]),
        reward("door1 lamp", &[("- -", "0 0 10 20")]),
    );
    document(variables, &functions)
}

#[test]
fn factored_models_are_multiplied_out() {
    let model = Pomdp::parse_pomdpx(&factored()).unwrap();
    let states = [
        "open_s0", "open_s1", "open_s2", "shut_s0", "shut_s1", "shut_s2",
    ];
    assert_eq!(model.states(), states);
    assert_eq!(
        model.observations(),
        ["open_on", "open_off", "shut_on", "shut_off"]
    );
    assert_eq!(model.actions(), ["go", "v2nd"], "names begin with a letter");
    assert!(
        model.warnings()[0]
            .message
            .contains("'2nd' is called 'v2nd'")
    );
    assert_eq!(model.start(), [0.25, 0.0, 0.0, 0.0, 0.375, 0.375]);
    assert_eq!(model.successors(0, 0), [(0, 1.0)]);
    assert_eq!(model.successors(0, 1), [(0, 0.5), (4, 0.0625), (5, 0.4375)]);
    assert_eq!(model.likelihood(0, 0), [0.75, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(model.likelihood(1, 3), [0.0, 0.0, 0.0, 0.25, 1.0, 1.0]);
    // -1, and what the door and the lamp give.
    assert_eq!(model.reward_of(0, 0, 3, 2), 9.0);
    assert_eq!(model.reward_of(2, 1, 5, 3), 24.0);
    // From open_s0 by the second action: shut and dark with 0.5, open with 0.5.
    assert_eq!(model.reward(0, 1), -1.0 + 0.5 * 20.0);
    assert_eq!(model, Pomdp::parse(&model.to_cassandra()).unwrap());
}

/// What is replaced in the tiger, by what, and the error's place and part.
const BROKEN: [[&str; 4]; 11] = [
    ["type=\"TBL\"", "type=\"DD\"", "line 10", "'DD' is not read"],
    ["0.15 0.85", "0.15", "line 21", "3 numbers, wanted are 4"],
    ["0.15 0.85", "0.15 0.95", "line 19", "sums to 1.0999"],
    ["0.85 0.15", "0.85 -0.15", "line 21", "allowed is 0 to 1"],
    [
        "listen - -",
        "lissen - -",
        "line 16",
        "'lissen' is no value of 'a'",
    ],
    ["<Var>s1", "<Var>s2", "line 14", "'s2' is no variable"],
    [
        "a s0</Parent>",
        "s1</Parent>",
        "line 14",
        "cannot depend on 's1'",
    ],
    ["0.95</Disc", "1.95</Disc", "line 4, column 1", "'1.95'"],
    ["<Variable>", "<Variable", "line 6", "not XML"],
    [
        "<ValueEnum>left right</ValueEnum>",
        "<NumValues>1000</NumValues>",
        "line 21",
        "4 numbers, wanted are 2000",
    ],
    [
        "InitialStateBelief",
        "Initial",
        "line 2",
        "InitialStateBelief",
    ],
];

#[test]
fn errors_name_the_place_and_what_is_allowed() {
    let mut cases: Vec<(String, &str, &str)> = Vec::new();
    for [what, by, place, part] in BROKEN {
        cases.push((tiger().replace(what, by), place, part));
    }
    let other = ("<pomdp/>".into(), "line 1, column 1", "wanted is <pomdpx>");
    cases.push(other);
    let text = factored().replace("<NumValues>3<", "<NumValues>60000<");
    cases.push((text, "line 5", "allowed are 100000"));
    let text = factored().replace("<Parent>null", "<Parent>charge0");
    let text = text.replace("<Instance>-<", "<Instance>* -<");
    cases.push((text, "line 12", "depend on each other"));
    for (text, place, part) in cases {
        let message = Pomdp::parse_pomdpx(&text).unwrap_err().to_string();
        let is_right = message.starts_with(place) && message.contains(part);
        assert!(is_right, "{place}, {part}: {message}");
    }
}

proptest! {
    #[test]
    fn a_damaged_document_is_read_or_refused(
        which in any::<bool>(), at in 0..1_000_000_usize, length in 0_usize..12,
        with in "[-0-9a-z<>/*\". ]{0,8}"
    ) {
        let text = if which { tiger() } else { factored() };
        let at = at % text.len();
        let end = (at + length).min(text.len());
        let damaged = format!("{}{with}{}", &text[..at], &text[end..]);
        if let Ok(model) = Pomdp::parse_pomdpx(&damaged) {
            prop_assert_eq!(&model, &Pomdp::parse(&model.to_cassandra()).unwrap());
        }
    }
}
