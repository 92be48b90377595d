//! What the launcher hands on is what it has read; and what a service takes from a configuration.

use std::path::PathBuf;

use vigil_cycle::serve::Leave;
use vigil_cycle::topic::ServiceName;
use vigil_setup::{Document, GraphArgs, ServiceArgs, load_model, load_robot};

fn config() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config")
}

fn args() -> GraphArgs {
    GraphArgs {
        config: config().join("corridor-people.toml"),
        ..GraphArgs::default()
    }
}

fn service(setup: Option<PathBuf>) -> ServiceArgs {
    ServiceArgs {
        graph: args(),
        setup,
        report: None,
        stamps: Some("s".into()),
        stamped_cycles: 7,
        no_timing: true,
        check: false,
    }
}

#[test]
fn a_document_read_again_is_the_same_to_the_last_bit() {
    let mut document = args().read().unwrap();
    // Values that a careless text would round.
    document.file.graph.seed = i64::MAX as u64;
    document.file.graph.rate_hz = 100.0 / 3.0;
    document.file.identifier.p_unknown = 0.1 + 0.2;
    for service in [
        &mut document.file.services.identifier,
        &mut document.file.services.supervisor,
    ] {
        service.core = 0;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("document");
    std::fs::write(&path, document.to_text().unwrap()).unwrap();
    assert_eq!(Document::read_text(&path).unwrap(), document);
    let handed_on = service(Some(path)).load().unwrap();
    assert_eq!(handed_on, document.check().unwrap());
    assert_eq!(handed_on.file.identifier.p_unknown, 0.1 + 0.2);
}

#[test]
fn a_document_that_is_none_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("document");
    for text in ["", "file = 1", "\u{1}"] {
        std::fs::write(&path, text).unwrap();
        let error = service(Some(path.clone())).load().unwrap_err();
        assert_eq!(error.problems[0].file, path, "{text}");
    }
    let missing = folder.path().join("none");
    let error = Document::read_text(&missing).unwrap_err().to_string();
    assert!(error.contains("none: cannot be read"), "{error}");
}

#[test]
fn a_seed_that_no_file_holds_is_refused() {
    let mut document = args().read().unwrap();
    document.file.graph.seed = u64::MAX;
    assert!(document.check().is_err());
}

#[test]
fn a_service_gets_its_place_and_times() {
    let mut document = args().read().unwrap();
    let identifier = &mut document.file.services.identifier;
    (identifier.core, identifier.spin_us) = (0, 0.0);
    document.file.services.supervisor.core = 0;
    let setup = document.check().unwrap();
    assert_eq!(setup.period_ns(), 10_000_000);
    assert_eq!(
        setup.resolve("a/b"),
        setup.path.with_file_name("a").join("b")
    );
    let identifier = setup.service(ServiceName::Identifier);
    assert_eq!(identifier.priority, 51);
    let leave = service(None).leave();
    let expected = Leave {
        report: None,
        stamps: Some(("s".into(), 7)),
        no_timing: true,
    };
    assert_eq!(leave, expected);
    let plan = setup.plan(ServiceName::Identifier, leave);
    assert_eq!(plan.schedule.deadline_ns, 7_500_000);
    // The budget's default is 80 %, but no more than the deadline.
    assert_eq!(plan.schedule.budget_ns, 7_500_000);
    assert_eq!((plan.wanted.core, plan.wanted.priority), (0, 51));
    assert_eq!(setup.domain().unwrap().graph(), "corridor-people");
}

#[test]
fn a_model_of_another_robot_is_refused() {
    let rover = load_robot(&config().join("robots/rover.toml")).unwrap();
    let model = config().join("models/kobuki.toml");
    assert!(load_model(&model, None).is_ok());
    let error = load_model(&model, Some(&rover)).unwrap_err().to_string();
    assert!(error.contains("kobuki"), "{error}");
}

#[test]
fn a_robot_out_of_its_ranges_is_refused_by_line_and_key() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.toml");
    let shipped = std::fs::read_to_string(config().join("robots/rover.toml")).unwrap();
    for (from, to, line, problem) in [
        (
            "yaw_rad = 0.005",
            "yaw_rad = 0.0",
            20,
            "noise.yaw_rad: 0 is out of range: allowed is above 0",
        ),
        (
            "length_m = 8.0 ",
            "length_m = -1 ",
            35,
            "tolerance.length_m: -1 is out of range: allowed is above 0 to 10000",
        ),
        (
            "current_a = 0.3 ",
            "current_a = 2e3 ",
            41,
            "tolerance.further.current_a: 2000 is out of range: allowed is above 0 to 1000",
        ),
        (
            "mass_kg = 14.2",
            "interval_s = 0.01",
            6,
            "interval_s: 0.01 is out of range: allowed is 0.02 to 0.3",
        ),
        (
            "y = 0.30, steered = true },\n  { name = \"LM\"",
            "y = nan, steered = true },\n  { name = \"LM\"",
            9,
            "wheels.0.y: NaN is out of range: allowed is any finite number",
        ),
    ] {
        std::fs::write(&path, shipped.replacen(from, to, 1)).unwrap();
        let error = load_robot(&path).unwrap_err().to_string();
        let wanted = format!("{}:{line}: {problem}", path.display());
        assert!(error.contains(&wanted), "{error}\n{wanted}");
    }
}
