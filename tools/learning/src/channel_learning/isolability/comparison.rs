//! In which windows each fault is detected, and told from each other one.

use vigil_inference::logspace::log_add;
use vigil_robot::channel_model::law::{BLOCKS, Row};
use vigil_robot::channel_model::model::Class;

use super::fault::{Fault, Signature, signature};
use super::rule::{Rule, Sight};
use super::snapshot::Snapshot;

/// Blocks since the onset that are looked at.
const AGES: [usize; 4] = [1, 2, 4, BLOCKS];

/// The signatures of all faults in a window, then its residuals, and their products.
pub(super) struct Products {
    /// The signatures.
    pub signatures: Vec<Signature>,
    first: usize,
    square: f64,
    /// Parts in it of the blocks before the first.
    before: Vec<f64>,
    /// `s_f' P s_g`, by rows.
    table: Vec<Vec<f64>>,
}

impl Products {
    /// Of a window, from block `first` on.
    pub fn new(faults: &[Fault], first: usize, snapshot: &Snapshot, rule: &Rule) -> Self {
        let one = |fault: &Fault| signature(fault, first, snapshot, &rule.targets, &rule.law);
        let mut signatures: Vec<Signature> = faults.iter().map(one).collect();
        signatures.push(Signature {
            rows: snapshot.z.iter().copied().enumerate().collect(),
            weighed: rule.law.weighed(&snapshot.z),
            silent: None,
        });
        let n = signatures.len();
        let mut table = vec![vec![0.0; n]; n];
        for f in 0..n {
            for g in f..n {
                table[f][g] = product(&signatures[f], &signatures[g]);
                table[g][f] = table[f][g];
            }
        }
        Self {
            signatures,
            first,
            square: snapshot.square,
            before: snapshot.parts[..first].to_vec(),
            table,
        }
    }

    /// A window with the first fault, seen as this one and as the second. A channel of which one
    /// of both says nothing takes no part. `more` adds to the product of two signatures.
    pub fn sights(
        &self,
        faults: &[Fault],
        pair: [usize; 2],
        rule: &Rule,
        more: impl Fn([usize; 2]) -> f64,
    ) -> [Sight; 2] {
        let [fault, _] = pair;
        let silent = pair.into_iter().find_map(|of| self.signatures[of].silent);
        let inner = |f: usize, g: usize| {
            let hidden = silent.map_or(0.0, |i| {
                let weighed = |of: usize| &self.signatures[of].weighed[i];
                rule.law.hidden(i, self.first, [weighed(f), weighed(g)])
            });
            self.table[f][g] - hidden + more([f, g])
        };
        let residuals = self.signatures.len() - 1;
        let square = self.square + 2.0 * inner(fault, residuals) + inner(fault, fault);
        pair.map(|of| {
            let product = inner(of, residuals) + inner(of, fault);
            Sight::new(&faults[of].extent, square, inner(of, of), product)
        })
    }

    /// True if the window excludes the second of two faults, where the first is there.
    pub fn exclude(
        &self,
        faults: &[Fault],
        pair: [usize; 2],
        rule: &Rule,
        more: impl Fn([usize; 2]) -> f64,
    ) -> bool {
        let sights = self.sights(faults, pair, rule, more);
        rule.excludes(pair.map(|fault| faults[fault].class), &sights)
    }

    /// True if a window with a fault is expected to alarm, for whatever reason.
    fn alarms(&self, faults: &[Fault], fault: usize, rule: &Rule) -> bool {
        let square = self.sights(faults, [fault, fault], rule, |_| 0.0)[0].square;
        let mut classes = rule.classes(square, &self.before);
        let mut add = |class: Class, log_odds: f64| {
            let slot = &mut classes[class as usize];
            *slot = log_add(*slot, log_odds);
        };
        let tried = faults
            .iter()
            .enumerate()
            .filter(|(_, of)| of.is_tried(self.first));
        for (rival, of) in tried {
            let [_, sight] = self.sights(faults, [fault, rival], rule, |_| 0.0);
            add(of.class, rule.log_odds(of, &sight));
        }
        let residuals = self.signatures.len() - 1;
        let weighed = [fault, residuals].map(|of| &self.signatures[of].weighed);
        for channel in 0..rule.targets.len() {
            let [one, other] = weighed.map(|rows| rows[channel]);
            let row: Row = std::array::from_fn(|block| one[block] + other[block]);
            let says = rule.law.hidden(channel, self.first, [&row, &row]);
            add(
                Class::Erratic,
                rule.erratic(channel, self.first, square, says),
            );
        }
        rule.alarms(&classes)
    }

    /// Adds to `sums` what each channel carries of the difference between a fault and so many times
    /// a rival.
    fn carry(&self, sums: &mut [f64], pair: [usize; 2], x: f64) {
        let [f, g] = pair.map(|of| &self.signatures[of]);
        let weighed = |i: usize, block: usize| f.weighed[i][block] - x * g.weighed[i][block];
        for (signature, factor) in [(f, 1.0), (g, -x)] {
            for (i, row) in &signature.rows {
                let part = row
                    .iter()
                    .enumerate()
                    .map(|(block, s)| s * weighed(*i, block));
                sums[*i] += factor * part.sum::<f64>();
            }
        }
    }
}

fn product(f: &Signature, g: &Signature) -> f64 {
    let rows = f.rows.iter();
    rows.map(|(i, row)| {
        let blocks = row.iter().zip(&g.weighed[*i]);
        blocks.map(|(a, b)| a * b).sum::<f64>()
    })
    .sum()
}

/// For each window how many blocks after its onset a fault shows; zero if not within the window.
pub(super) struct Comparison {
    /// Is detected, by fault.
    pub detected: Vec<Vec<u8>>,
    /// Is told from a rival, by fault and rival.
    pub told: Vec<Vec<Vec<u8>>>,
    /// What each channel carries of a fault.
    pub carried: Vec<Vec<f64>>,
}

impl Comparison {
    /// Of all windows.
    pub fn new(faults: &[Fault], log: &[Snapshot], rule: &Rule) -> Self {
        let n = faults.len();
        let mut found = Self {
            detected: vec![vec![0; log.len()]; n],
            told: vec![vec![vec![0; log.len()]; n]; n],
            carried: vec![vec![0.0; rule.targets.len()]; n],
        };
        for (window, snapshot) in log.iter().enumerate() {
            for age in AGES {
                found.take(faults, window, age, snapshot, rule);
            }
        }
        found
    }

    fn take(
        &mut self,
        faults: &[Fault],
        window: usize,
        age: usize,
        snapshot: &Snapshot,
        rule: &Rule,
    ) {
        let first = BLOCKS - age;
        let products = Products::new(faults, first, snapshot, rule);
        let tried = |(_, fault): &(usize, &Fault)| fault.is_tried(first);
        for (f, _) in faults.iter().enumerate().filter(tried) {
            if self.detected[f][window] == 0 && products.alarms(faults, f, rule) {
                self.detected[f][window] = age as u8;
            }
            for g in (0..faults.len()).filter(|&g| g != f) {
                let told = &mut self.told[f][g][window];
                if *told == 0 && products.exclude(faults, [f, g], rule, |_| 0.0) {
                    *told = age as u8;
                }
            }
            if age == BLOCKS {
                products.carry(&mut self.carried[f], [f, f], 0.0);
            }
        }
    }

    /// Windows that show a fault.
    pub fn windows(&self, fault: usize) -> usize {
        self.detected[fault]
            .iter()
            .filter(|blocks| **blocks > 0)
            .count()
    }

    /// Share of all windows that show a fault.
    pub fn seen(&self, fault: usize) -> f64 {
        self.windows(fault) as f64 / self.detected[fault].len().max(1) as f64
    }

    /// Share of the windows that show either fault in which it is told from the other; the smaller
    /// of both.
    pub fn apart(&self, pair: [usize; 2]) -> f64 {
        let [one, other] = pair;
        let share = |f: usize, g: usize| {
            let both = self.detected[f].iter().zip(&self.told[f][g]);
            let told = both.filter(|(seen, told)| **seen > 0 && **told > 0).count();
            told as f64 / self.windows(f).max(1) as f64
        };
        share(one, other).min(share(other, one))
    }
}

/// For each pair what each channel carries of the difference between its faults, over all windows.
pub(super) fn carried(
    pairs: &[[usize; 2]],
    faults: &[Fault],
    log: &[Snapshot],
    rule: &Rule,
) -> Vec<Vec<f64>> {
    let mut found = vec![vec![0.0; rule.targets.len()]; pairs.len()];
    for snapshot in log.iter().filter(|_| !pairs.is_empty()) {
        let products = Products::new(faults, 0, snapshot, rule);
        for (pair, sums) in pairs.iter().zip(&mut found) {
            let [_, rival] = products.sights(faults, *pair, rule, |_| 0.0);
            products.carry(sums, *pair, rival.factor);
        }
    }
    found
}
