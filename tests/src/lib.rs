//! Tests that span processes, and tidy checks.
