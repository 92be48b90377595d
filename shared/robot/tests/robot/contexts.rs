//! What of a declared context is refused, in a description and in a model file.

use std::collections::BTreeMap;

use vigil_robot::channel_model::Model;
use vigil_robot::channel_model::component::unfit;
use vigil_robot::channel_model::context_change::{
    AGES, ChangeAge, ContextChange, ContextChanges, StepDirection,
};
use vigil_robot::context_table::DeclaredContext;

use super::channel_model::robot;

fn declared(text: &str) -> Vec<DeclaredContext> {
    toml::from_str::<BTreeMap<String, Vec<DeclaredContext>>>(text).unwrap()["context"].clone()
}

#[test]
fn a_context_has_a_name_of_its_own_and_shows_in_channels_that_are_there() {
    let refused = |text: &str| {
        let mut robot = robot("kobuki");
        robot.context = declared(text);
        unfit(&robot)
    };
    let good = "context = [{ name = 'ground' }, { name = 'load', shows = ['enc_L', 'enc_R'] }]";
    assert_eq!(refused(good), None);
    for (text, said) in [
        ("context = [{ name = 'enc_L' }]", "its name is taken"),
        ("context = [{ name = 'LEFT_TYRE' }]", "its name is taken"),
        ("context = [{ name = 'WHEEL_L' }]", "its name is taken"),
        (
            "context = [{ name = 'a' }, { name = 'a' }]",
            "its name is taken",
        ),
        ("context = [{ name = 'ND' }]", "a word of Vigil's own"),
        ("context = [{ name = 'wet floor' }]", "letters, digits"),
        ("context = [{ name = '' }]", "'' is no name"),
        (
            "context = [{ name = 'a', shows = ['enc_X'] }]",
            "'enc_X', which is no channel",
        ),
    ] {
        let refused = refused(text).unwrap_or_default();
        assert!(
            refused.starts_with("context '") && refused.contains(said),
            "{text}: {refused}"
        );
    }
    let five = (0..5).map(|i| format!("{{ name = 'c{i}' }}"));
    let five = format!("context = [{}]", five.collect::<Vec<_>>().join(", "));
    assert!(refused(&five).unwrap().contains("5 contexts"));
}

/// The Kobuki's model with a change of this context, which needs so many weights.
fn model(context: &str, weights: usize) -> Model {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../config/models/kobuki.toml"
    );
    let mut model = Model::from_toml(&std::fs::read_to_string(path).unwrap()).unwrap();
    model.declared_context = declared("context = [{ name = 'ground' }]");
    let direction = StepDirection {
        weights: vec![0.5; weights],
        ratio: 7.0,
    };
    let age = ChangeAge {
        direction: vec![direction],
    };
    model.contexts = ContextChanges {
        change: vec![ContextChange {
            context: context.to_owned(),
            runs: 9,
            threshold: 5.0,
            age: vec![age; AGES],
        }],
    };
    model.sealed()
}

#[test]
fn a_model_holds_changes_of_its_channels_and_of_declared_contexts() {
    let read = |model: &Model| Model::from_toml(&model.to_toml().unwrap());
    let channels = model("ground", 1).channel.len();
    let good = model("ground", channels);
    assert_eq!(read(&good).unwrap(), good);
    let refused = |model: &Model| read(model).unwrap_err().to_string();
    let wrong = refused(&model("ground", channels + 1));
    assert!(
        wrong.contains("contexts") && wrong.contains("4 ages"),
        "{wrong}"
    );
    let wrong = refused(&model("wind", channels));
    assert!(
        wrong.contains("contexts.change.0.context") && wrong.contains("each declared context once"),
        "{wrong}"
    );
    let mut twice = good.clone();
    twice.contexts.change.push(twice.contexts.change[0].clone());
    let wrong = refused(&twice.sealed());
    assert!(wrong.contains("contexts.change.1.context"), "{wrong}");
}

#[test]
fn a_model_is_of_the_contexts_that_were_declared_when_it_was_learned() {
    let model = model("ground", 1);
    let mut robot = robot("kobuki");
    let refused = model.check_robot(&robot).unwrap_err().to_string();
    assert!(refused.contains("; contexts ground"), "{refused}");
    robot.context = declared("context = [{ name = 'ground' }]");
    model.check_robot(&robot).unwrap();
    robot.context[0].shows = vec!["enc_L".to_owned()];
    let refused = model.check_robot(&robot).unwrap_err().to_string();
    assert!(refused.contains("ground (shows in enc_L)"), "{refused}");
}
