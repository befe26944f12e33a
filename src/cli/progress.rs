//! What a run shows while it goes on: a line for everything that matters, and a bar.

use indicatif::{ProgressBar, ProgressStyle};

use crate::supervisor::{Event, EventKind};

/// Heads the columns of the lines that [`step`] makes.
const HEAD: &str = "[   cell   ] step                            by                   feature seen    conf.   mode    tool             duration  nearest";

/// Shows the events of a run to a person.
pub(super) struct Screen {
    bar: ProgressBar,
    boxes: u32,
}

impl Screen {
    pub(super) fn new() -> Self {
        let bar = ProgressBar::new(0);
        bar.set_style(
            ProgressStyle::with_template("{wide_bar} {pos}/{len} steps  {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        Self { bar, boxes: 0 }
    }

    /// A line on standard output, above the bar.
    fn line(&self, text: &str) {
        self.bar.suspend(|| anstream::println!("{text}"));
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    pub(super) fn show(&mut self, event: &Event) {
        let time = event.time_s;
        match &event.kind {
            EventKind::RunStarted { cell, product, boxes, steps, seed } => {
                self.boxes = *boxes;
                self.bar.set_length(u64::from(*boxes) * *steps as u64);
                self.line(&format!("cell {cell}, product {product}: {boxes} box(es) of {steps} steps, seed {seed}"));
            }
            EventKind::BoxStarted { number } => {
                self.line(&format!("\n[{time:7.2} s] box {number} of {}", self.boxes));
                self.line(HEAD);
            }
            EventKind::StepStarted { label, .. } => self.bar.set_message(label.clone()),
            EventKind::ActionStarted { subject, subtask, part } => {
                self.bar.set_message(format!("{part}: {subject} {subtask}"));
            }
            EventKind::StepDone { .. } => {
                self.bar.inc(1);
                self.line(&step(time, &event.kind));
            }
            EventKind::BoxDone { number, completed, duration_s } => {
                let word = if *completed { "done" } else { "not completed" };
                self.line(&format!("[{time:7.2} s] box {number} {word} in {duration_s:.1} s"));
            }
            other => {
                if let Some(text) = remark(other) {
                    self.line(&format!("[{time:7.2} s]     {text}"));
                }
            }
        }
    }
}

/// The line of a finished step: who, what was seen, how, how long, how near.
fn step(time: f64, kind: &EventKind) -> String {
    let EventKind::StepDone {
        step,
        label,
        outcome,
        who,
        class,
        confidence,
        mode,
        tool,
        form,
        attempts,
        duration_s,
        clearance_min_m,
        ..
    } = kind
    else {
        return String::new();
    };
    let clearance = clearance_min_m.map_or("      -".to_owned(), |clearance| format!("{:4.0} mm", clearance * 1e3));
    let tries = if *attempts > 1 { format!(", attempt {attempts}") } else { String::new() };
    let outcome = if *outcome == "done" { String::new() } else { format!(", {outcome}") };
    let by = subject(who, form);
    format!(
        "[{time:7.2} s] {step:2} {label:29} {by:20} {class:13} {:5.1} %  {mode:7} {tool:16} {duration_s:5.1} s {clearance}{tries}{outcome}",
        confidence * 100.0
    )
}

/// Who did a step, and in which of the forms of Fig. 5.
fn subject(who: &str, form: &str) -> String {
    match (who, form) {
        ("human", "hand_over") => "person, handed over".to_owned(),
        ("human", "hold") => "person, robot holds".to_owned(),
        ("human", _) => "person".to_owned(),
        (who, _) => who.to_owned(),
    }
}

/// What interrupts the even flow of steps; `None` for what only `--json` tells.
fn remark(kind: &EventKind) -> Option<String> {
    Some(match kind {
        EventKind::Doubt { part, look, reason } => format!("{part}: look {look} is not good enough: {reason}"),
        EventKind::Verdict { part, assigned, reason, robot_reach_margin_m, robot_load_margin_kg, .. }
            if *assigned != "robot" =>
        {
            // Eq. (2): what is within the robot's reach and load and yet not its own is flexible.
            let why = match (*robot_reach_margin_m > 0.0, *robot_load_margin_kg > 0.0) {
                (false, _) => "it is out of the robot's reach",
                (_, false) => "it is too heavy for the robot",
                (true, true) => "it is flexible",
            };
            format!("{part}: {reason}: {why}")
        }
        EventKind::Fallback { subtask, part, from, planner } => {
            format!("{part}: {subtask}: every {from} path is blocked; planned by {planner}")
        }
        EventKind::WayChanged { subtask, part, reason, planner } => match *reason {
            "blocked" => format!("{part}: {subtask}: something came into the way; round it, planned by {planner}"),
            reason => format!("{part}: {subtask}: over to a {reason} way, planned by {planner}"),
        },
        EventKind::Prompt { text, .. } => format!("to the person: {text}"),
        EventKind::Answer { answer, class, .. } if *answer != "done" && *answer != "started" => {
            format!("the person: {answer}{}", class.map(|class| format!(" ({class})")).unwrap_or_default())
        }
        EventKind::Stop { cause, category, separation_m, clearance_m } => {
            let person = separation_m.map(|d| format!(", person at {d:.2} m")).unwrap_or_default();
            format!("STOP category {category}: {cause}, clearance {:.0} mm{person}", clearance_m * 1e3)
        }
        EventKind::Mode { mode, reason } => {
            let why = reason.map(|reason| format!(": {reason}")).unwrap_or_default();
            format!("{mode} speed{why}")
        }
        EventKind::Resumed { cause, after_s } => format!("resumed {after_s:.1} s after the stop ({cause})"),
        EventKind::Fault { role, fault } => format!("FAULT {role}: {fault}"),
        EventKind::Recovered { role, after_s } => format!("{role} is back after {after_s:.2} s"),
        EventKind::Retry { part, attempt, reason } => format!("{part}: attempt {attempt} failed: {reason}"),
        _ => return None,
    })
}
