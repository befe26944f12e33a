//! Distances between the arm and everything it must not touch, and the separation a person is owed.
