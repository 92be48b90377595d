//! Temporary.
#![allow(clippy::unwrap_used)]
use std::time::Instant;
use vigil_blocks::SensorFrame;
use vigil_robot::{Fault, FaultKind};
use vigil_sensor_sim::*;
use vigil_setup::schema::*;
fn main() {
    let robot = vigil_setup::load_robot(std::path::Path::new("config/robots/rover.toml")).unwrap();
    let seg = |d, k, v| DriveSegment {
        duration_s: d,
        curvature_1_m: k,
        speed_m_s: v,
    };
    let drive = [
        seg(8., 0.5, 0.2),
        seg(6., 0., 0.2),
        seg(8., -0.4, 0.2),
        seg(6., 0., 0.25),
    ];
    for rate in [1000.0, 100.0, 20.0] {
        for mask in [0u32, 0b000010, 0b010000, 0b010010, 0b001011] {
            let mut w = World::new(&robot, &Simulator::default(), &drive, rate, 1).unwrap();
            let mut f = SensorFrame::default();
            let n = (60.0 * rate) as usize;
            let mut t = Vec::with_capacity(n);
            for k in 0..n {
                let a = Instant::now();
                if k == n / 10 {
                    for i in 0..6 {
                        if mask >> i & 1 == 1 {
                            w.inject(Fault {
                                kind: FaultKind::Stuck,
                                wheel: i,
                            })
                            .unwrap();
                        }
                    }
                }
                w.step(1.0 / rate, EffectiveCommand::as_planned(w.planned()));
                w.measure(&mut f);
                t.push(a.elapsed().as_nanos() as f64 / 1e3);
            }
            let inj = t[n / 10];
            t.sort_by(f64::total_cmp);
            println!(
                "{rate} {mask:06b} p50 {:.1} p99 {:.1} p999 {:.1} max {:.1} us; at injection {inj:.1}; unsolved {}",
                t[n / 2],
                t[n * 99 / 100],
                t[n * 999 / 1000],
                t[n - 1],
                w.unsolved()
            );
        }
    }
    // Cold solves over a grid: iterations.
    use vigil_robot::slip::*;
    let m = SlipModel::new(&robot).unwrap();
    let mut hist = std::collections::BTreeMap::new();
    for mask in 0u32..64 {
        if mask.count_ones() > 3 {
            continue;
        }
        for k in -12..=12 {
            for v in [0.02, 0.05, 0.1, 0.2, 0.3, 0.5] {
                let s = Situation {
                    curvature_1_m: k as f64 * 0.1,
                    speed_m_s: v,
                    stuck: std::array::from_fn(|i| mask >> i & 1 == 1),
                    soil: Soil::default(),
                };
                let a = Instant::now();
                let r = m.solve(&s, None).unwrap();
                let us = a.elapsed().as_nanos() as f64 / 1e3;
                let e = hist
                    .entry((mask.count_ones(), r.iterations))
                    .or_insert((0, 0.0f64));
                e.0 += 1;
                e.1 = e.1.max(us);
            }
        }
    }
    for ((c, it), (n, us)) in hist {
        println!("{c} stuck, {it} iterations: {n}, max {us:.1} us");
    }
}
