//! POMDP models, solvers, policies and belief tracking.
