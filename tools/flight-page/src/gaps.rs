//! Which blocks are missing, by their sequence numbers.

use std::collections::BTreeMap;

use vigil_blocks::Header;
use vigil_cycle::topic::Topic;
use vigil_pages::page::{remark, table};

/// Gaps that are named.
const GAPS_MAX: usize = 60;

/// What is known of a topic.
#[derive(Debug, Default)]
struct Numbers {
    last: Option<(u64, u64)>,
    blocks: u64,
    missing: u64,
}

/// Which blocks are missing.
#[derive(Debug, Default)]
pub(crate) struct Gaps {
    topics: BTreeMap<String, Numbers>,
    gaps: Vec<Vec<String>>,
    count: usize,
}

impl Gaps {
    /// Takes the head of a block.
    pub(crate) fn take(&mut self, t_s: f64, topic: Topic, header: &Header) {
        let name = topic.name();
        let numbers = self.topics.entry(name.clone()).or_default();
        numbers.blocks += 1;
        let last = numbers.last.replace((header.epoch, header.seq));
        // The black box keeps only some of the particles.
        if matches!(topic, Topic::DetectionParticles | Topic::DiagnosisParticles) {
            return;
        }
        let Some((_, before)) = last.filter(|(epoch, _)| *epoch == header.epoch) else {
            return;
        };
        let missing = header.seq.saturating_sub(before.saturating_add(1));
        if missing == 0 {
            return;
        }
        numbers.missing = numbers.missing.saturating_add(missing);
        self.count += 1;
        if self.gaps.len() < GAPS_MAX {
            let numbers = match missing {
                1 => (before + 1).to_string(),
                _ => format!("{} to {}", before + 1, header.seq - 1),
            };
            let row = [format!("{t_s:.3}"), name, numbers, missing.to_string()];
            self.gaps.push(row.to_vec());
        }
    }

    /// What was recorded of each topic, and what is missing.
    pub(crate) fn tables(&self) -> String {
        let row = |(name, numbers): (&String, &Numbers)| {
            let counts = [numbers.blocks, numbers.missing].map(|count| count.to_string());
            [vec![name.clone()], counts.to_vec()].concat()
        };
        let rows: Vec<Vec<String>> = self.topics.iter().map(row).collect();
        let mut found = table(&["topic", "blocks", "missing"], &rows);
        if self.gaps.is_empty() {
            found.push_str(&remark(
                "No sequence number is missing between the first and the last.",
            ));
            return found;
        }
        let heads = [
            "found at, s",
            "topic",
            "missing sequence numbers",
            "how many",
        ];
        found.push_str(&table(&heads, &self.gaps));
        let further = self.count - self.gaps.len();
        if further > 0 {
            found.push_str(&remark(&format!(
                "{further} further gaps are left out here."
            )));
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_numbers_are_named_and_another_start_is_no_gap() {
        let mut gaps = Gaps::default();
        for (epoch, seq) in [
            (1, 0),
            (1, 1),
            (1, 5),
            (2, 9),
            (2, 8),
            (2, u64::MAX),
            (2, u64::MAX),
        ] {
            let header = Header {
                epoch,
                seq,
                ..Header::default()
            };
            gaps.take(1.0, Topic::Sensor, &header);
            gaps.take(1.0, Topic::DetectionParticles, &header);
        }
        let tables = gaps.tables();
        assert!(tables.contains("<td>2 to 4</td><td>3</td>"), "{tables}");
        assert_eq!(gaps.count, 2);
    }
}
