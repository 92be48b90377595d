//! A configuration whose alarm could never rise is refused.

use std::fs;
use std::path::Path;

use crate::shipped::load;
use tempfile::TempDir;
use vigil_diagnosis::detect::Form;
use vigil_setup::graph_file::GraphFile;

/// The rover's model, had its log-odds without a fault a tail that hardly falls.
fn long_tailed(folder: &Path) -> String {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
    let text = fs::read_to_string(config.join("models/rover.toml")).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for line in &mut lines {
        if line.starts_with("hash = ") {
            *line = "hash = \"edited\"".to_owned();
        } else if line.starts_with("tail_slope = ") {
            *line = "tail_slope = 0.1".to_owned();
        }
    }
    let path = folder.join("model.toml");
    fs::write(&path, lines.join("\n")).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn an_alarm_that_could_never_rise_is_refused_with_line_key_and_bound() {
    let folder = TempDir::new().unwrap();
    let model = long_tailed(folder.path());
    let changed = |form: Form, interval_h: f64| {
        load("rover.toml", |file| {
            file.files.model.clone_from(&model);
            file.detector.form = form;
            file.detector.false_alarm_interval_h = interval_h;
        })
    };
    assert_eq!(changed(Form::Windowed, 0.01), Ok(()));
    let message = changed(Form::Windowed, 24.0).unwrap_err();
    let place = message.split_once("rover.toml:").unwrap().1;
    let (line, rest) = place.split_once(": ").unwrap();
    assert!(line.parse::<usize>().unwrap() > 20, "{message}");
    assert!(rest.starts_with("detector.false_alarm_interval_h: at most one false alarm in 24 h"));
    assert!(
        rest.contains("'windowed'") && rest.contains("at the highest"),
        "{message}"
    );
}

#[test]
fn a_form_that_the_model_is_not_calibrated_for_is_refused() {
    let with =
        |name: &str, form: Form| load(name, |file: &mut GraphFile| file.detector.form = form);
    for form in [Form::LearnedBias, Form::Windowed, Form::EDetector] {
        assert_eq!(with("rover.toml", form), Ok(()));
    }
    assert_eq!(with("kobuki.toml", Form::LearnedBias), Ok(()));
    let message = with("kobuki.toml", Form::Windowed).unwrap_err();
    assert!(
        message.contains("no calibration for 'pose+encoders' and 'windowed'"),
        "{message}"
    );
    let message = with("kobuki.toml", Form::EDetector).unwrap_err();
    assert!(
        message.contains("detector.form: the form 'e-detector' needs a model with a motion"),
        "{message}"
    );
}
