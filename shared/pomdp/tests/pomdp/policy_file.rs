//! Policy files: exact round trips, refusals, hostile bytes.

use proptest::prelude::*;
use vigil_pomdp::alpha_vectors::VectorError;
use vigil_pomdp::policy_file::{PolicyFile, PolicyFileError, alpha, appl};
use vigil_pomdp::{AlphaVectors, PointBased, Policy, Pomdp};

const MODEL: &str = "discount: 0.9\nstates: a b\nactions: go stay\nobservations: x y\n\
    start: 0.5 0.5\nT: go identity\nT: stay uniform\nO: * uniform\nR: * : * : * : * -1.5\n";

fn model() -> Pomdp {
    Pomdp::parse(MODEL).unwrap()
}

fn file(values: &[f64]) -> PolicyFile {
    let model = model();
    let rows = values.chunks(2).enumerate().map(|(i, v)| (i % 2, v));
    PolicyFile {
        model_hash: model.hash(),
        discount: 0.9,
        method: "sarsop".into(),
        lower: -15.0,
        upper: Some(-0.1 - 0.2),
        cpu_s: 0.25,
        vectors: AlphaVectors::new(2, 2, rows).unwrap(),
    }
}

#[test]
fn a_policy_of_another_model_is_refused() {
    let bytes = file(&[1.0, 2.0]).write(&model()).unwrap();
    let other = Pomdp::parse(&MODEL.replace("-1.5", "-1.25")).unwrap();
    let error = PolicyFile::read(&bytes, &other).unwrap_err();
    assert!(matches!(error, PolicyFileError::Model { .. }), "{error}");
    assert!(
        error
            .to_string()
            .contains(&format!("{:016x}", other.hash()))
    );
    let commented = Pomdp::parse(&MODEL.replace('\n', " # the same\n")).unwrap();
    assert!(PolicyFile::read(&bytes, &commented).is_ok());
}

#[test]
fn what_is_wrong_is_said_precisely() {
    let text = String::from_utf8(file(&[1.0, 2.0]).write(&model()).unwrap()).unwrap();
    let read = |text: &str| PolicyFile::read(text.as_bytes(), &model()).unwrap_err();
    let vectors = |error| PolicyFileError::Vectors(error);
    assert_eq!(
        read(&text.replace("[1.0,2.0]", "[1.0]")),
        vectors(VectorError::Length {
            vector: 0,
            found: 1,
            states: 2
        })
    );
    assert_eq!(
        read(&text.replace("\"action\":0", "\"action\":2")),
        vectors(VectorError::Action {
            vector: 0,
            found: 2,
            max: 1
        })
    );
    assert_eq!(
        read(&text.replace("vigil-policy", "policy")),
        PolicyFileError::Magic("policy".into())
    );
    assert_eq!(
        read(&text.replace("\"version\":1", "\"version\":2")),
        PolicyFileError::Version(2)
    );
    for (from, to) in [
        ("[1.0,2.0]", "[1.0,NaN]"),
        ("[1.0,2.0]", "[1.0,null]"),
        ("2.0", "1e999"),
    ] {
        let error = read(&text.replace(from, to));
        assert!(
            matches!(error, PolicyFileError::Syntax { .. }),
            "{to}: {error}"
        );
    }
    let crossed = read(&text.replace("\"lower\":-15.0", "\"lower\":15"));
    assert!(
        matches!(crossed, PolicyFileError::Bounds { .. }),
        "{crossed}"
    );
    let empty = read(&text.replace("{\"action\":0,\"values\":[1.0,2.0]}", ""));
    assert_eq!(empty, vectors(VectorError::None));
}

#[test]
fn every_truncation_is_refused() {
    let bytes = file(&[1.0, -2.5e-7, 3.0, 0.1]).write(&model()).unwrap();
    for length in 0..bytes.len() - 1 {
        let error = PolicyFile::read(&bytes[..length], &model()).unwrap_err();
        assert!(
            matches!(error, PolicyFileError::Syntax { .. }),
            "{length}: {error}"
        );
    }
}

#[test]
fn files_of_other_programs_are_read() {
    // The layout that APPL writes.
    let xml = "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n<Policy version=\"0.1\" \
        type=\"value\" model=\"m.pomdp\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
        xsi:noNamespaceSchemaLocation=\"policyx.xsd\">\n<AlphaVector vectorLength=\"2\" \
        numObsValue=\"1\" numVectors=\"2\">\n<Vector action=\"1\" obsValue=\"0\">-81.5 2e1 \
        </Vector>\n<Vector action=\"0\" obsValue=\"0\">3 4 </Vector>\n</AlphaVector> </Policy>";
    let wanted = AlphaVectors::new(2, 2, [(1, [-81.5, 20.0]), (0, [3.0, 4.0])]).unwrap();
    assert_eq!(appl::read(xml, &model()), Ok(wanted.clone()));
    assert_eq!(
        alpha::read("1\n-81.5 20.0\n\n0\n3 4 # c\n", &model()),
        Ok(wanted)
    );
    for (from, to, part) in [
        (
            "vectorLength=\"2\"",
            "vectorLength=\"3\"",
            "number of states",
        ),
        ("numVectors=\"2\"", "numVectors=\"3\"", "number of Vector"),
        ("numObsValue=\"1\"", "numObsValue=\"2\"", "allowed is 1"),
        ("3 4", "3 four", "'four'"),
        ("3 4", "3 inf", "finite"),
        ("action=\"1\"", "action=\"7\"", "0 to 1"),
        ("Policy", "Polity", "'Policy'"),
    ] {
        let error = appl::read(&xml.replace(from, to), &model()).unwrap_err();
        assert!(error.to_string().contains(part), "{to}: {error}");
    }
    let error = alpha::read("0\n", &model()).unwrap_err();
    assert_eq!(error, alpha::AlphaTextError::Short(1));
}

#[test]
fn the_policy_begins_the_best_plan() {
    let vectors = [(0, [10.0, 0.0]), (1, [0.0, 10.0]), (0, [6.0, 6.0])];
    let vectors = AlphaVectors::new(2, 2, vectors).unwrap();
    let policy = &mut PointBased::new(&model(), &vectors).unwrap();
    let mut values = [0.0; 2];
    let choice = policy.evaluate(&[0.5, 0.5], &mut values);
    assert_eq!((choice.action, values), (0, [6.0, 5.0]));
    assert_eq!(policy.evaluate(&[0.1, 0.9], &mut values).action, 1);
    assert!((values[1] - 9.0).abs() < 1e-12);
}

proptest! {
    #[test]
    fn numbers_come_back_bit_for_bit(
        values in prop::collection::vec(any::<f64>().prop_filter("finite", |v| v.is_finite()), 8)
    ) {
        let (file, model) = (file(&values), model());
        let read = PolicyFile::read(&file.write(&model).unwrap(), &model).unwrap();
        let bits = |v: &AlphaVectors| -> Vec<u64> {
            v.rows().flat_map(|(_, v)| v.iter().map(|v| v.to_bits())).collect()
        };
        prop_assert_eq!(bits(&read.vectors), bits(&file.vectors));
        prop_assert_eq!(&read, &file);
        let text = alpha::write(&file.vectors);
        prop_assert_eq!(bits(&alpha::read(&text, &model).unwrap()), bits(&file.vectors));
        let xml = appl::write(&file.vectors, "a<b>&\"c\"");
        prop_assert_eq!(bits(&appl::read(&xml, &model).unwrap()), bits(&file.vectors));
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = PolicyFile::read(&bytes, &model());
        let text = String::from_utf8_lossy(&bytes);
        let _ = alpha::read(&text, &model());
        let _ = appl::read(&text, &model());
    }

    #[test]
    fn damaged_files_are_read_or_refused(
        at in 0_usize..400, length in 0_usize..8, with in "[-0-9a-z\"<>{}\\[\\]:,. \n]{0,8}"
    ) {
        let (file, model) = (file(&[1.0, 2.0, -3.5, 4e-9]), model());
        let damaged = |text: &str| {
            let (at, end) = (at.min(text.len()), (at + length).min(text.len()));
            format!("{}{with}{}", &text[..at], &text[end..])
        };
        let own = String::from_utf8(file.write(&model).unwrap()).unwrap();
        if let Ok(read) = PolicyFile::read(damaged(&own).as_bytes(), &model) {
            prop_assert_eq!(read.vectors.states(), 2);
            let is_fine = |(a, v): (usize, &[f64])| a < 2 && v.iter().all(|v| v.is_finite());
            prop_assert!(read.vectors.rows().all(is_fine));
        }
        let _ = appl::read(&damaged(&appl::write(&file.vectors, "m")), &model);
        let _ = alpha::read(&damaged(&alpha::write(&file.vectors)), &model);
    }
}
