//! A configuration whose alarm could never rise is refused.

mod shipped;

use shipped::load;
use vigil_diagnosis::detect::Form;
use vigil_setup::graph_file::GraphFile;

#[test]
fn an_alarm_that_could_never_rise_is_refused_with_line_key_and_bound() {
    assert_eq!(load("kobuki.toml", |_| ()), Ok(()));
    assert_eq!(
        load("rover.toml", |file| file.detector.form = Form::Windowed),
        Ok(())
    );
    let message = load("kobuki.toml", |file| file.detector.form = Form::Windowed).unwrap_err();
    let place = message.split_once("kobuki.toml:").unwrap().1;
    let (line, rest) = place.split_once(": ").unwrap();
    assert!(line.parse::<usize>().unwrap() > 20, "{message}");
    assert!(rest.starts_with("detector.false_alarm_interval_h: at most one false alarm in 24 h"));
    assert!(
        rest.contains("'windowed'") && rest.contains("at the highest"),
        "{message}"
    );
    let with_proof = |file: &mut GraphFile| file.detector.form = Form::EDetector;
    assert_eq!(load("rover.toml", with_proof), Ok(()));
    let message = load("kobuki.toml", with_proof).unwrap_err();
    assert!(
        message.contains("detector.form: the form 'e-detector' needs a model with a motion"),
        "{message}"
    );
    let seldom = |file: &mut GraphFile| {
        file.detector.form = Form::Windowed;
        file.detector.false_alarm_interval_h = 5.0;
    };
    assert_eq!(load("kobuki.toml", seldom), Ok(()));
}
