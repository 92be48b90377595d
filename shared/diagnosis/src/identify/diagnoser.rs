//! The identifier's step: an identifier of either kind, under the detector's blindness.

use vigil_blocks::{DetectionBelief, Entry, FaultBelief, ParticleBlock};
use vigil_checkpoint::Checkpoint;

use crate::identify::blind_override::BlindOverride;
use crate::identify::channel_identifier::ChannelIdentifier;
use crate::identify::identifier::{Identifier, Input};
use crate::invariants;

/// An identifier of either kind; while the detector is blind, its names are BLIND.
#[derive(Debug, Clone, Checkpoint)]
pub struct Diagnoser {
    identifier: EitherIdentifier,
    blind: BlindOverride,
}

#[derive(Debug, Clone, Checkpoint)]
enum EitherIdentifier {
    /// Over the faults that the rover's model knows.
    Faults(Box<Identifier>),
    /// Over the components of a model of channels.
    Channels(Box<ChannelIdentifier>),
}

impl Diagnoser {
    /// See [`Identifier::particles`]; 0 without any.
    #[must_use]
    pub fn particles(&self) -> u32 {
        match &self.identifier {
            EitherIdentifier::Faults(identifier) => identifier.particles(),
            EitherIdentifier::Channels(_) => 0,
        }
    }

    /// See [`Identifier::particles_in_use`].
    #[must_use]
    pub fn particles_in_use(&self) -> u32 {
        match &self.identifier {
            EitherIdentifier::Faults(identifier) => identifier.particles_in_use(),
            EitherIdentifier::Channels(_) => 0,
        }
    }

    /// Takes one entry of the journal; see [`Identifier::step`].
    // Never merged into its caller, so that its instructions can be counted.
    #[inline(never)]
    pub fn step(
        &mut self,
        entry: Entry<Input<'_>>,
        belief: &mut FaultBelief,
        hypotheses: &mut ParticleBlock,
    ) {
        if let Entry::Frame(Input {
            detection: Some((detection, _)),
            ..
        }) = entry
        {
            self.look(detection);
        }
        match &mut self.identifier {
            EitherIdentifier::Faults(identifier) => identifier.step(entry, belief, hypotheses),
            EitherIdentifier::Channels(channels) => channels.step(entry, belief, hypotheses),
        }
        let p = belief.p;
        self.blind.cover(belief);
        invariants::held(&p, &belief.p);
        invariants::name(belief.mode, belief.node_count as usize);
        invariants::name(belief.reported, belief.node_count as usize);
    }

    /// Takes a detection without a frame behind it: only its blindness counts.
    pub const fn look(&mut self, detection: &DetectionBelief) {
        self.blind.look(detection);
    }
}

impl From<ChannelIdentifier> for Diagnoser {
    fn from(channels: ChannelIdentifier) -> Self {
        Self {
            identifier: EitherIdentifier::Channels(Box::new(channels)),
            blind: BlindOverride::default(),
        }
    }
}

impl From<Identifier> for Diagnoser {
    fn from(identifier: Identifier) -> Self {
        Self {
            identifier: EitherIdentifier::Faults(Box::new(identifier)),
            blind: BlindOverride::default(),
        }
    }
}
