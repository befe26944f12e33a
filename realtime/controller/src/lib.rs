//! The controller role: plans a motion, follows it at a fixed rate, owns the protective stop.
