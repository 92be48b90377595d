//! No tuple or array parameter whose values differ in meaning.

use vigil_size::Source;

use crate::{demand_none, sample, workspace};

fn violations(sources: &[Source]) -> Vec<String> {
    let of = |source: &Source| {
        let path = source.path.clone();
        let parameters = source
            .rust
            .parameters
            .iter()
            .filter(|one| !source.is_test(one.line));
        let lines =
            parameters.map(|one| format!("{path}:{}: fn {}({})", one.line, one.function, one.text));
        lines.collect::<Vec<String>>()
    };
    sources.iter().flat_map(of).collect()
}

#[test]
fn parameters_are_no_tuples_or_arrays_of_unlike_values() {
    demand_none("Give the values names: a struct.", &violations(workspace()));
}

#[test]
fn tuples_and_arrays_of_unlike_values_are_refused() {
    let bad = "fn a(x: (f64, f64)) {}\nfn b([y_ns, z_ns]: [u64; 2]) {}\n\
               fn c(x: &(u8, f64, u8)) {}\n";
    assert_eq!(violations(&[sample("shared/a/src/b.rs", bad)]).len(), 3);
    let good = "fn a(x: (usize, f64)) {}\nfn b(x: [f64; 3]) {}\nfn c([a, b]: [Name; 2]) {}\n\
                #[cfg(test)]\nmod tests {\n    fn a(x: (f64, f64)) {}\n}\n";
    assert_eq!(
        violations(&[sample("shared/a/src/b.rs", good)]),
        Vec::<String>::new()
    );
}
