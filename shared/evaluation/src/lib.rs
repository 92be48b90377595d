//! Data sets, learning of models, scoring.
