use super::*;

fn noise() -> WheelNoise {
    WheelNoise {
        wheel: "L".to_owned(),
        squares: vec![4.0; ORDERS],
        ripple: vec![0.0; ORDERS],
    }
}

fn signature() -> TurningSignature {
    TurningSignature {
        fault: "tyre".to_owned(),
        runs: 1,
        real: vec![1.0, 0.0, -0.5, 0.2, 0.0],
        imaginary: vec![0.0, 2.0, 0.5, 0.0, 0.1],
    }
}

fn fault(wheel: usize) -> TurningFault {
    TurningFault {
        wheel,
        noise: noise(),
        signature: signature(),
    }
}

fn orders(memory: usize, amplitude: f64, beside: f64) -> WheelOrders {
    WheelOrders {
        wheel: 0,
        memory_turns: MEMORIES_TURNS[memory],
        turns: 1e3,
        gain: [1.0, 2.0][memory],
        amplitudes: (0..ORDERS)
            .map(|h| Complex::from_polar(amplitude, h as f64))
            .collect(),
        beside: vec![Some(beside); ORDERS],
        shared: Vec::new(),
    }
}

/// Mean of the ratios of two Gaussian densities, phase by phase and size by size, of a fault that
/// is so much larger than it was learned.
fn by_densities(standardized: &[Complex<f64>], growth: f64) -> f64 {
    let learned = signature();
    let mut sum = 0.0;
    for phase in 0..PHASES {
        let angle = TAU * phase as f64 / PHASES as f64;
        for size in SIZES {
            let mut log_ratio = 0.0;
            for (h, y) in standardized.iter().enumerate() {
                let turned = Complex::from_polar(1.0, -(h as f64 + 1.0) * angle);
                let mean =
                    Complex::new(learned.real[h], learned.imaginary[h]) * turned * size * growth;
                log_ratio += y.norm_sqr() - (y - mean).norm_sqr();
            }
            sum += f64::exp(log_ratio);
        }
    }
    (sum / (PHASES * SIZES.len()) as f64).ln()
}

#[test]
fn the_ratio_is_that_of_two_gaussian_laws_over_phases_and_sizes() {
    // Noise of the log 4, of the last turns 16, weighed alike: a variance of 10.
    let found = orders(0, 3.0, 16.0);
    let standardized: Vec<_> = found
        .amplitudes
        .iter()
        .map(|one| one / 10_f64.sqrt())
        .collect();
    let ratio_of = |orders: &WheelOrders| fault(0).log_ratio(std::slice::from_ref(orders)).unwrap();
    let (ratio, expected) = (ratio_of(&found), by_densities(&standardized, 1.0));
    assert!((ratio - expected).abs() < 1e-12, "{ratio} {expected}");
    // Over four times as many turns a fault of that size has twice the amplitude.
    let long = WheelOrders {
        memory_turns: MEMORIES_TURNS[1],
        gain: 2.0,
        ..found.clone()
    };
    let (ratio, expected) = (ratio_of(&long), by_densities(&standardized, 2.0));
    assert!((ratio - expected).abs() < 1e-9, "{ratio} {expected}");
    // What the last turns do not show says nothing, as if nothing had been learned of it.
    let mut unseen = found;
    unseen.beside[1] = None;
    let mut less = fault(0);
    less.signature.imaginary[1] = 0.0;
    let expected = less.log_ratio(std::slice::from_ref(&unseen)).unwrap();
    let mut mute = unseen.clone();
    mute.amplitudes[1] = Complex::default();
    mute.beside[1] = Some(16.0);
    assert!((ratio_of(&unseen) - expected).abs() < 1e-12);
    assert!((less.log_ratio(&[mute]).unwrap() - expected).abs() < 1e-12);
}

#[test]
fn memories_are_averaged_once_filled_and_other_wheels_say_nothing() {
    let (short, long) = (orders(0, 3.0, 4.0), orders(1, 9.0, 4.0));
    let of = |orders: &[WheelOrders]| fault(0).log_ratio(orders);
    let [a, b] = [&short, &long].map(|one| of(std::slice::from_ref(one)).unwrap().exp());
    let both = of(&[short.clone(), long.clone()]).unwrap();
    assert!((both - (0.5 * (a + b)).ln()).abs() < 1e-12);
    let unfilled = WheelOrders { turns: 1.0, ..long };
    assert!((of(&[short.clone(), unfilled.clone()]).unwrap() - a.ln()).abs() < 1e-12);
    assert!(of(&[unfilled]).is_none());
    assert!(of(&[WheelOrders { wheel: 1, ..short }]).is_none());
}

#[test]
fn a_wheel_that_is_never_round_is_no_fault() {
    let found = orders(0, 9.0, 4.0);
    let mut odd = fault(0);
    odd.noise.ripple = vec![40.0; ORDERS];
    let found = [found];
    let of = |fault: &TurningFault| fault.log_ratio(&found).unwrap();
    assert!(
        of(&odd) < 0.3 * of(&fault(0)),
        "{} {}",
        of(&odd),
        of(&fault(0))
    );
    // Of forty times the noise: as an amplitude over √41.
    let mut less = found.clone();
    less[0]
        .amplitudes
        .iter_mut()
        .for_each(|one| *one /= 41_f64.sqrt());
    assert!((of(&odd) - fault(0).log_ratio(&less).unwrap()).abs() < 1e-9);
}

/// What two wheels show of a fault of the first one, if so much of its turns is in those of the
/// other.
fn of_first(shared: f64, second: f64) -> [WheelOrders; 2] {
    let phase =
        |order: usize, turns: f64| Complex::from_polar(1.0, -TAU * turns * (order + 1) as f64);
    let shown = |of: &TurningFault, turns: f64| -> Vec<Complex<f64>> {
        (0..ORDERS)
            .map(|h| 6.0 * of.learned(h) * phase(h, turns))
            .collect()
    };
    let [first, other] = [shown(&fault(0), 0.25), shown(&fault(1), 0.5)];
    let mut wheels = [0, 1].map(|wheel| WheelOrders {
        wheel,
        ..orders(0, 0.0, 4.0)
    });
    wheels[0].amplitudes = first.clone();
    // The second wheel is a tenth of a turn ahead.
    let ahead: ByOrder = std::array::from_fn(|h| shared * phase(h, 0.1));
    for (h, amplitude) in wheels[1].amplitudes.iter_mut().enumerate() {
        *amplitude = ahead[h] * first[h] + second * other[h];
    }
    wheels[1].shared = vec![(0, ahead)];
    wheels
}

#[test]
fn what_one_fault_explains_does_not_speak_for_a_second() {
    let [first, second] = [fault(0), fault(1)];
    let alone = |orders: &[WheelOrders]| second.log_ratio(orders).unwrap();
    let beside_first =
        |orders: &[WheelOrders]| second.log_ratio_beside(&first.explained(orders), orders);
    let beside = |orders: &[WheelOrders]| beside_first(orders).unwrap();
    let alike = of_first(1.0, 0.0);
    assert!(
        alone(&alike) > 20.0 && beside(&alike) < 0.0,
        "{} {}",
        alone(&alike),
        beside(&alike)
    );
    let both = of_first(1.0, 1.0);
    assert!(beside(&both) > 10.0, "{}", beside(&both));
    // Until both wheels have turned far enough nobody knows what the first one explains.
    let mut unfilled = of_first(1.0, 0.0);
    unfilled[0].turns = 1.0;
    assert!(beside_first(&unfilled).is_none());
    let apart = of_first(0.0, 1.0);
    assert!((alone(&apart) - beside(&apart)).abs() < 1e-12);
}

#[test]
fn an_odd_file_does_not_fit() {
    let of = |real: usize, square: f64| TurningSignatures {
        wheel: vec![WheelNoise {
            wheel: "L".to_owned(),
            squares: vec![square; ORDERS],
            ripple: vec![0.0; ORDERS],
        }],
        fault: vec![TurningSignature {
            real: vec![0.0; real],
            ..signature()
        }],
    };
    assert!(of(ORDERS, 1.0).fits(1) && TurningSignatures::default().fits(7));
    assert!(!of(ORDERS, 1.0).fits(2) && !of(4, 1.0).fits(1));
    for wrong in [f64::NAN, -1.0, f64::INFINITY] {
        assert!(!of(ORDERS, wrong).fits(1), "{wrong}");
    }
    let mut wrong = of(ORDERS, 1.0);
    wrong.wheel[0].ripple[1] = -0.5;
    assert!(!wrong.fits(1));
    let mut wrong = of(ORDERS, 1.0);
    wrong.fault[0].imaginary[2] = f64::NAN;
    assert!(!wrong.fits(1));
}
