//! Tandem, the workcell controller.
