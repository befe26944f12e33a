//! The role against a scripted cell, every failure path included.

mod fake;

use super::*;
use crate::strategy::StepState;
use fake::{Fake, Script};
use tandem_config::Cell;
use tandem_msg::{
    Coded, EffectorAction, FeatureClass, MotionFailure, PromptKind, Role, RunMode, StopCause, Subtask, Tool,
};

const FILM: usize = 9;
const CABLE: usize = 6;
const SHELL: usize = 0;

#[test]
fn a_box_is_assembled_with_every_form_of_cooperation() {
    let run = Fake::new(Script::default(), 1).run();
    assert_eq!(run.outcome, Outcome::Completed);
    assert_eq!(run.outcomes(), ["done"; 10]);
    let forms = ["robot", "alone", "robot", "robot", "robot", "robot", "hold", "robot", "robot", "hand_over"];
    assert_eq!(run.forms(), forms);
    let summary = run.summary();
    assert_eq!((summary.boxes_completed, summary.steps_done, summary.steps_failed, summary.stops), (1, 10, 0, 0));
    assert_eq!(summary.min_clearance_m, Some(0.02));
    let tools: Vec<&str> = run
        .fake
        .seen
        .iter()
        .filter_map(|event| match &event.kind {
            EventKind::Strategy { tool, .. } => Some(*tool),
            _ => None,
        })
        .collect();
    for tool in Tool::ALL.iter().filter(|tool| **tool != Tool::None) {
        assert!(tools.contains(&tool.name()), "{tool} is never used: {tools:?}");
    }
}

#[test]
fn two_boxes_run_alike_and_the_same_run_tells_the_same() {
    let first = Fake::new(Script::default(), 2).run();
    let second = Fake::new(Script::default(), 2).run();
    assert_eq!(first.outcome, Outcome::Completed);
    assert_eq!(first.summary().boxes_completed, 2);
    assert_eq!(first.fake.seen, second.fake.seen);
    assert_eq!(first.fake.journal, second.fake.journal);
}

/// Every attempt has one line at its beginning and one at its end, numbered without a gap,
/// and nothing is begun before its line is durable.
#[test]
fn the_journal_has_a_beginning_and_an_end_for_every_attempt() {
    let script = Script { motion_fails: Some((Subtask::Place, MotionFailure::ActionFailed, 1)), ..Script::default() };
    let run = Fake::new(script, 1).run();
    let journal = &run.fake.journal;
    let numbers: Vec<u64> = journal.iter().map(|entry| entry.seq).collect();
    assert_eq!(numbers, (1..=numbers.len() as u64).collect::<Vec<_>>());
    for entry in journal.iter().filter(|entry| entry.state != StepState::Started) {
        let began = journal.iter().any(|other| {
            other.state == StepState::Started
                && (other.step, other.attempt) == (entry.step, entry.attempt)
                && other.seq < entry.seq
        });
        assert!(began, "{entry:?}");
        assert_eq!(entry.serial, "s471-test-0001");
    }
    let ends: Vec<_> =
        journal.iter().filter(|entry| entry.step == 0).map(|entry| (entry.attempt, entry.state)).collect();
    use StepState::{Done, Failed, Started};
    assert_eq!(ends, [(1, Started), (1, Failed), (2, Started), (2, Done)]);
}

#[test]
fn a_part_in_the_tool_is_placed_again_and_not_fetched_again() {
    let script = Script { motion_fails: Some((Subtask::Place, MotionFailure::ActionFailed, 1)), ..Script::default() };
    let run = Fake::new(script, 1).run();
    assert_eq!(run.outcome, Outcome::Completed);
    let shell: Vec<_> = run.fake.tasks[..5].iter().filter_map(|(task, _)| task.subtask.get()).collect();
    use Subtask::{Grasp, Place, Transfer};
    assert_eq!(shell, [Grasp, Transfer, Place, Transfer, Place]);
}

#[test]
fn a_lost_part_is_called_for_again() {
    let script = Script { motion_fails: Some((Subtask::Transfer, MotionFailure::PartLost, 1)), ..Script::default() };
    let run = Fake::new(script, 1).run();
    assert_eq!(run.outcome, Outcome::Completed);
    let shell: Vec<_> = run.fake.tasks[..4].iter().filter_map(|(task, _)| task.subtask.get()).collect();
    use Subtask::{Grasp, Place, Transfer};
    assert_eq!(shell, [Grasp, Transfer, Grasp, Transfer]);
    assert!(!shell.contains(&Place));
    assert_eq!(run.summary().steps_failed, 1);
}

#[test]
fn after_the_last_attempt_a_person_takes_over() {
    let script =
        Script { motion_fails: Some((Subtask::Assemble, MotionFailure::ActionFailed, 3)), ..Script::default() };
    let run = Fake::new(script, 1).run();
    assert_eq!(run.outcome, Outcome::Completed);
    assert_eq!(run.outcomes().iter().filter(|outcome| **outcome == "taken_over").count(), 1);
    assert_eq!(run.summary().steps_failed, 3);
    let remark = run.fake.journal.iter().find(|entry| entry.state == StepState::TakenOver).map(|e| e.remark.clone());
    assert_eq!(remark.as_deref(), Some("assemble: action_failed"));
}

#[test]
fn what_cannot_help_is_not_repeated() {
    let script = Script { motion_fails: Some((Subtask::Grasp, MotionFailure::Unreachable, 1)), ..Script::default() };
    let run = Fake::new(script, 1).run();
    assert_eq!(run.outcomes()[0], "taken_over");
    assert_eq!(run.summary().steps_failed, 1);
}

#[test]
fn a_motion_that_never_ends_is_given_up() {
    let script = Script { motion_hangs: Some(Subtask::Transfer), ..Script::default() };
    let run = Fake::new(script, 1).run();
    assert_eq!(run.outcome, Outcome::Completed);
    let reasons =
        run.events(|kind| matches!(kind, EventKind::Retry { reason, .. } if reason == "transfer: no end within 60 s"));
    assert_eq!(reasons, 3 * 7, "three attempts at each of the seven robot-focused steps");
}

#[test]
fn an_unsure_look_is_repeated() {
    let run = Fake::new(Script { unsure: Some((SHELL, 2)), ..Script::default() }, 1).run();
    assert_eq!(run.outcomes(), ["done"; 10]);
    assert_eq!(run.events(|kind| matches!(kind, EventKind::Doubt { .. })), 2);
    assert!(run.fake.prompts.iter().all(|(kind, _)| *kind != PromptKind::Identify));
}

#[test]
fn an_unsure_model_asks_the_person_whose_word_is_written_down() {
    let run = Fake::new(Script { unsure: Some((SHELL, 9)), ..Script::default() }, 1).run();
    assert_eq!(run.outcome, Outcome::Completed);
    assert!(run.fake.prompts.contains(&(PromptKind::Identify, SHELL)));
    let by = |event: &Event| matches!(&event.kind, EventKind::Recognised { by: "person", class: "smooth_hole", .. });
    assert!(run.fake.seen.iter().any(by));
    let remark = &run.fake.journal[0].remark;
    assert_eq!(remark, "unsure: smooth_hole at 55 %; the person says it is smooth_hole");
    let doubt = run.fake.seen.iter().find_map(|event| match &event.kind {
        EventKind::Recognised { confidence, .. } => Some(*confidence),
        _ => None,
    });
    assert_eq!(doubt, Some(0.55), "their word does not raise the model's confidence");
}

#[test]
fn a_wrong_part_is_not_assembled_by_the_robot() {
    let script = Script {
        other_class: Some((SHELL, FeatureClass::Buckle)),
        says: Some(FeatureClass::Buckle),
        ..Script::default()
    };
    let run = Fake::new(script, 1).run();
    assert_eq!(run.outcomes()[0], "taken_over");
    let remark = &run.fake.journal[0].remark;
    assert_eq!(remark, "saw buckle, the part has smooth_hole; the person sees buckle");
    let before = run.fake.prompts.iter().position(|(kind, _)| *kind == PromptKind::TakeOver);
    assert!(before.is_some() && run.fake.tasks.iter().all(|(task, _)| !task.subtask.is(Subtask::None)));
}

#[test]
fn a_part_far_off_its_place_is_looked_at_by_the_person() {
    let run = Fake::new(Script { off_place: Some((SHELL, 0.05)), ..Script::default() }, 1).run();
    assert_eq!(run.outcomes()[0], "done");
    assert!(run.fake.prompts.contains(&(PromptKind::Inspect, SHELL)));
}

#[test]
fn perception_that_never_answers_leads_to_a_question() {
    let run = Fake::new(Script { blind: Some(SHELL), ..Script::default() }, 1).run();
    assert_eq!(run.outcome, Outcome::Completed);
    let silent =
        run.events(|kind| matches!(kind, EventKind::Doubt { reason, .. } if reason == "no recognition in time"));
    assert_eq!(silent, 3);
}

#[test]
fn what_nobody_can_do_is_unassignable_and_asked() {
    let heavy = |cell: &mut Cell| cell.product.parts[SHELL].mass = 10.0;
    let run = Fake::with(Script::default(), 1, heavy).run();
    assert_eq!(run.outcomes()[0], "taken_over");
    assert_eq!(run.fake.journal[0].remark, "unassignable: neither can");
    let harmful = |cell: &mut Cell| cell.product.parts[CABLE].harmful = true;
    let run = Fake::with(Script::default(), 1, harmful).run();
    assert_eq!(run.outcomes()[CABLE], "taken_over");
    let remark = run.fake.journal.iter().find(|entry| entry.step == CABLE as u32).map(|entry| entry.remark.clone());
    assert_eq!(remark.as_deref(), Some("unassignable: only the person could, but the part is harmful"));
}

#[test]
fn a_declined_hand_over_is_offered_again() {
    let run = Fake::new(Script { declines: Some((PromptKind::Receive, 1)), ..Script::default() }, 1).run();
    assert_eq!(run.outcome, Outcome::Completed);
    let offers = run.fake.prompts.iter().filter(|prompt| **prompt == (PromptKind::Receive, FILM)).count();
    assert_eq!(offers, 2);
}

#[test]
fn a_box_nobody_will_finish_is_given_up() {
    let script = Script {
        declines: Some((PromptKind::TakeOver, 1)),
        motion_fails: Some((Subtask::Grasp, MotionFailure::Unreachable, 1)),
        ..Script::default()
    };
    let run = Fake::new(script, 2).run();
    assert_eq!(run.outcome, Outcome::Failed { reason: "1 of 2 boxes not completed".into() });
    assert_eq!(run.summary().boxes_completed, 1);
    assert_eq!(run.outcomes()[0], "failed");
}

#[test]
fn a_person_who_never_answers_ends_the_run() {
    for kind in [PromptKind::Assemble, PromptKind::Receive, PromptKind::AssembleHeld] {
        let run = Fake::new(Script { mute: Some(kind), ..Script::default() }, 1).run();
        assert_eq!(run.outcome, Outcome::Completed, "{kind}: another asks, and they take over");
        assert_eq!(run.outcomes().iter().filter(|outcome| **outcome == "taken_over").count(), 1, "{kind}");
    }
    let script = Script {
        mute: Some(PromptKind::TakeOver),
        motion_fails: Some((Subtask::Grasp, MotionFailure::Unreachable, 1)),
        ..Script::default()
    };
    let run = Fake::new(script, 1).run();
    assert_eq!(run.outcome, Outcome::TimedOut { waiting_for: "a person to finish bottom_shell by hand".into() });
}

#[test]
fn every_stop_is_followed_by_motion_again() {
    for &cause in StopCause::ALL.iter().filter(|cause| **cause != StopCause::None) {
        let run = Fake::new(Script { stops: Some((Subtask::Transfer, cause)), ..Script::default() }, 1).run();
        assert_eq!(run.outcome, Outcome::Completed, "{cause}");
        assert_eq!(run.outcomes(), ["done"; 10], "{cause}");
        assert_eq!(run.summary().stops, 1, "{cause}");
        let resumed = |kind: &EventKind| matches!(kind, EventKind::Resumed { cause: of, .. } if *of == cause.name());
        assert_eq!(run.events(resumed), 1, "{cause}");
        let looked = run.fake.prompts.iter().any(|(kind, _)| *kind == PromptKind::Inspect);
        let eyes = [
            StopCause::Clearance,
            StopCause::Workspace,
            StopCause::TrackingError,
            StopCause::JointLimit,
            StopCause::Internal,
        ];
        assert_eq!(looked, eyes.contains(&cause), "{cause}");
    }
}

/// Each motion that the next planner had to plan is told once, and counted.
#[test]
fn fallbacks_are_told() {
    let run = Fake::new(Script { sampled: Some(Subtask::Transfer), ..Script::default() }, 1).run();
    assert_eq!(run.outcome, Outcome::Completed);
    let transfers = run
        .events(|kind| matches!(kind, EventKind::ActionDone { subtask: "transfer", planner: Some("rrt_connect"), .. }));
    let told = run.events(|kind| {
        matches!(kind, EventKind::Fallback { subtask: "transfer", from: "manual", planner: "rrt_connect", .. })
    });
    assert!(transfers > 0 && told == transfers, "{transfers} transfers, {told} told");
    assert_eq!(run.summary().fallbacks as usize, told);
}

#[test]
fn a_cell_found_unfit_ends_the_run() {
    let script = Script {
        stops: Some((Subtask::Transfer, StopCause::Clearance)),
        declines: Some((PromptKind::Inspect, 1)),
        ..Script::default()
    };
    let run = Fake::new(script, 1).run();
    let fault = "a person found the cell not fit to go on".to_owned();
    assert_eq!(run.outcome, Outcome::Fault { role: "arm", fault });
}

#[test]
fn a_controller_that_comes_back_goes_on_at_the_boundary() {
    for subtask in [
        Subtask::Grasp,
        Subtask::Transfer,
        Subtask::Place,
        Subtask::Assemble,
        Subtask::ToolChange,
        Subtask::HandOver,
        Subtask::HoldStill,
        Subtask::Home,
    ] {
        let run = Fake::new(Script { loses: Some((Role::Controller, subtask, true)), ..Script::default() }, 1).run();
        assert_eq!(run.outcome, Outcome::Completed, "{subtask}");
        assert_eq!(run.outcomes(), ["done"; 10], "{subtask}");
        let lost =
            |kind: &EventKind| matches!(kind, EventKind::Fault { role: "controller", fault } if fault == "killed");
        assert_eq!(run.events(lost), 1, "{subtask}");
        assert_eq!(run.events(|kind| matches!(kind, EventKind::Recovered { role: "controller", .. })), 1, "{subtask}");
        let ids: Vec<u32> = run.fake.tasks.iter().map(|(task, _)| task.id).filter(|id| *id != 0).collect();
        assert!(ids.windows(2).all(|pair| pair[0] < pair[1]), "a task is never sent again under its number: {ids:?}");
    }
}

#[test]
fn perception_that_comes_back_costs_nothing() {
    let run =
        Fake::new(Script { loses: Some((Role::Perception, Subtask::Transfer, true)), ..Script::default() }, 1).run();
    assert_eq!((run.outcome.clone(), run.outcomes()), (Outcome::Completed, vec!["done"; 10]));
}

#[test]
fn a_role_that_stays_away_ends_the_run() {
    for role in [Role::Perception, Role::Controller, Role::Plant] {
        let run = Fake::new(Script { loses: Some((role, Subtask::Transfer, false)), ..Script::default() }, 1).run();
        assert_eq!(run.outcome, Outcome::Fault { role: role.name(), fault: "killed".into() });
        assert!(run.fake.outputs.task.run.is(RunMode::Halt));
    }
}

#[test]
fn a_plant_that_comes_back_knows_nothing_and_ends_the_run_all_the_same() {
    let run = Fake::new(Script { loses: Some((Role::Plant, Subtask::Transfer, true)), ..Script::default() }, 1).run();
    assert_eq!(run.outcome, Outcome::Fault { role: "plant", fault: "killed".into() });
}

#[test]
fn no_step_begins_without_its_journal() {
    let run = Fake::new(Script { journal_max: Some(4), ..Script::default() }, 1).run();
    let fault = "an entry was not durable within 10 s".to_owned();
    assert_eq!(run.outcome, Outcome::Fault { role: "journal", fault });
    assert_eq!(run.outcomes(), ["done"; 2]);
    assert_eq!(run.fake.journal.len(), 5, "the beginning of the third step is the last thing written");
    assert!(run.fake.tasks.iter().all(|(task, _)| !task.subtask.is(Subtask::Assemble)));
}

#[test]
fn an_interrupted_run_stops_the_arm_first() {
    let run = Fake::new(Script { halts: Some(Subtask::Transfer), ..Script::default() }, 1).run();
    assert_eq!(run.outcome, Outcome::Interrupted);
    assert!(run.fake.outputs.task.run.is(RunMode::Halt));
    assert_eq!(run.fake.motion.standstill, 1);
}

/// Every task is finite, reachable by id in the scene it was made for, and a hand is never
/// empty where a part should be.
#[test]
fn tasks_are_whole() {
    let run = Fake::new(Script::default(), 1).run();
    for (task, objects) in run.fake.tasks.iter().filter(|(task, _)| task.id != 0) {
        assert!(task.base_from_tcp.is_valid() && task.speed > 0.0 && task.speed <= 1.0, "{task:?}");
        for id in task.touch.iter().filter(|id| **id != 0) {
            assert!(objects.contains(id), "object {id} is not in the scene {objects:?}");
        }
        let mut unique = objects.clone();
        unique.dedup();
        assert_eq!(unique.len(), objects.len());
        let carries = !matches!(task.subtask.get(), Some(Subtask::Grasp | Subtask::ToolChange | Subtask::Home));
        assert_eq!(task.attached_before.present == 1, carries, "{:?}", task.subtask);
        assert_eq!(
            task.attached_after.present == 1,
            matches!(task.action.get(), Some(EffectorAction::Keep | EffectorAction::Grasp))
                && !task.subtask.is(Subtask::Home)
        );
    }
    let last = run.fake.tasks.last().map(|(_, objects)| objects.len());
    assert_eq!(last, Some(5 + 9), "bench, fixture, two carriers, rack, and nine parts in the box");
    assert!(run.fake.prompts.iter().all(|(_, part)| *part < 10));
}
