//! What is drawn.

use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Monotonic};
use vigil_timeline::TimelineEntry;

use super::palette::Palette;
use crate::status::Document;
use crate::watch::{Histories, History, View};

/// What is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    pub document: &'a Document,
    pub histories: &'a Histories,
    pub events: &'a [TimelineEntry],
    pub palette: Palette,
    pub now_ns: u64,
    /// Events that are newer than the last one in the picture.
    pub scroll: usize,
    pub has_help: bool,
}

impl<'a> Scene<'a> {
    /// Of the present.
    pub fn new(document: &'a Document, view: &'a View, palette: Palette) -> Self {
        Self {
            document,
            histories: &view.histories,
            events: &view.events,
            palette,
            now_ns: Monotonic.now_ns(),
            scroll: 0,
            has_help: false,
        }
    }

    /// The cycle times of a service.
    pub fn history(&self, service: &str) -> Option<&'a History> {
        let mut all = ServiceName::ALL.into_iter();
        let found = all.find(|name| name.as_str() == service)?;
        self.histories.cycle_us.get(found.index())
    }
}
