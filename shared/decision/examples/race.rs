//! x
#![allow(missing_docs, clippy::unwrap_used)]
use vigil_decision::{Budget, Pomdp, solver};
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/schedstat").unwrap();
    s.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let limit: f64 = args[2].parse().unwrap();
    let precision: f64 = args.get(3).map_or(1e-9, |p| p.parse().unwrap());
    let model = Pomdp::parse(&std::fs::read_to_string(&args[1]).unwrap()).unwrap();
    let mut stop = || cpu() > limit;
    let mut budget = Budget::new(&mut stop);
    let mut next = 0.1;
    let opts = solver::Options {
        precision,
        ..Default::default()
    };
    let f = solver::solve(&model, &opts, &mut budget, &mut |p| {
        if cpu() > next {
            next *= 1.6;
            println!("{:.2} {:.6} {p:?}", cpu(), p.bracket.gap());
        }
    })
    .unwrap();
    println!(
        "{:.4} {:.3e} [{:.8} {:.8}] {:?} {:?} export {}",
        cpu(),
        f.bracket.gap(),
        f.bracket.lower,
        f.bracket.upper,
        f.progress,
        f.ended,
        f.vectors.as_ref().map_or(0, |v| v.len())
    );
}
