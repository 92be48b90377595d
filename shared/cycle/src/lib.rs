//! Real-time cycle: clock, placement, deadlines, histograms, ports.
