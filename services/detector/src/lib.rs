//! Detects any deviation from nominal behaviour.
