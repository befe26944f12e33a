//! Every way an arm under way can be stopped: how soon, how, under which name, and what it takes to go on.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod cell;

use cell::{Cell, Tamper, down, task};
use tandem_msg::*;

/// One thing that goes wrong while the arm is under way.
struct Fault {
    what: &'static str,
    cause: StopCause,
    category: StopCategory,
    /// Cycles from the fault to the stop monitor's answer.
    noticed_within: u64,
    begin: fn(&mut Cell),
    end: fn(&mut Cell),
}

fn tampered(cell: &mut Cell, tamper: Tamper) {
    cell.tamper = Some(tamper);
}

fn mended(cell: &mut Cell) {
    cell.tamper = None;
}

const FROZEN: Capsule = Capsule { ends: [[4.0, 0.0, -0.9], [4.0, 0.0, 0.7]], radius: 0.25, velocity: [0.0; 3] };

/// The faults, each with how it begins and how it ends.
fn faults() -> Vec<Fault> {
    use StopCategory::{One, Two};
    vec![
        Fault {
            what: "the arm's state is frozen",
            cause: StopCause::ArmStale,
            category: One,
            noticed_within: 12,
            begin: |cell| cell.arm_alive = false,
            end: |cell| cell.arm_alive = true,
        },
        Fault {
            what: "the tracked person is frozen",
            cause: StopCause::HumanStale,
            category: One,
            noticed_within: 52,
            begin: |cell| cell.human_alive = false,
            end: |cell| cell.human_alive = true,
        },
        Fault {
            what: "the tracker repeats one picture under fresh stamps",
            cause: StopCause::HumanStale,
            category: One,
            noticed_within: 52,
            begin: |cell| {
                cell.person_at(4.0, 0.0, [0.0; 3]);
                tampered(cell, |_, human, _, _, _| human.capsules[..2].fill(FROZEN));
            },
            end: mended,
        },
        Fault {
            what: "the supervisor is silent",
            cause: StopCause::SupervisorStale,
            category: One,
            noticed_within: 102,
            begin: |cell| cell.supervisor_alive = false,
            end: |cell| cell.supervisor_alive = true,
        },
        Fault {
            what: "a position is no number",
            cause: StopCause::InputInvalid,
            category: One,
            noticed_within: 1,
            begin: |cell| tampered(cell, |arm, _, _, _, _| arm.position[2] = f64::NAN),
            end: mended,
        },
        Fault {
            what: "a velocity is absurd",
            cause: StopCause::InputInvalid,
            category: One,
            noticed_within: 1,
            begin: |cell| tampered(cell, |arm, _, _, _, _| arm.velocity[0] = 1e6),
            end: mended,
        },
        Fault {
            what: "another arm answers",
            cause: StopCause::InputInvalid,
            category: One,
            noticed_within: 1,
            begin: |cell| tampered(cell, |arm, _, _, _, _| arm.joint_count = 7),
            end: mended,
        },
        Fault {
            what: "a person is no number",
            cause: StopCause::InputInvalid,
            category: One,
            noticed_within: 1,
            begin: |cell| {
                tampered(cell, |_, human, _, _, _| {
                    human.capsule_count = 1;
                    human.capsules[0].ends[0][0] = f64::NAN;
                });
            },
            end: mended,
        },
        Fault {
            what: "a person has too many limbs",
            cause: StopCause::InputInvalid,
            category: One,
            noticed_within: 1,
            begin: |cell| tampered(cell, |_, human, _, _, _| human.capsule_count = 99),
            end: mended,
        },
        Fault {
            what: "the run mode means nothing",
            cause: StopCause::InputInvalid,
            category: One,
            noticed_within: 11,
            begin: |cell| tampered(cell, |_, _, _, task, _| task.run = Code::from_raw(9)),
            end: mended,
        },
        Fault {
            what: "samples come from the future",
            cause: StopCause::InputInvalid,
            category: One,
            noticed_within: 1,
            begin: |cell| tampered(cell, |arm, _, _, _, _| arm.header.stamp = Stamp(u64::MAX)),
            end: mended,
        },
        Fault {
            what: "the scene has an object that is none",
            cause: StopCause::SceneInvalid,
            category: One,
            noticed_within: 11,
            begin: |cell| {
                cell.scene.objects[0].size[0] = f64::NAN;
                cell.scene.version += 1;
            },
            end: |cell| {
                cell.scene.objects[0].size[0] = 0.775;
                cell.scene.version += 1;
            },
        },
        Fault {
            what: "a replaced arm process wakes up",
            cause: StopCause::ForeignWriter,
            category: One,
            noticed_within: 1,
            begin: |cell| cell.arm.header.epoch -= 1,
            end: |cell| cell.arm.header.epoch += 1,
        },
        Fault {
            what: "a peer of another configuration speaks",
            cause: StopCause::ForeignWriter,
            category: One,
            noticed_within: 1,
            begin: |cell| cell.human.header.config_hash = 8,
            end: |cell| cell.human.header.config_hash = 7,
        },
        Fault {
            what: "the arm does not follow",
            cause: StopCause::TrackingError,
            category: One,
            noticed_within: 2,
            begin: |cell| cell.drag = 0.1,
            end: |cell| cell.drag = 0.0,
        },
        Fault {
            what: "the arm has closed its brakes",
            cause: StopCause::PlantBraked,
            category: One,
            noticed_within: 1,
            begin: |cell| {
                tampered(cell, |arm, _, _, _, _| {
                    arm.fault = Code::of(PlantFault::CommandExpired);
                    arm.command_seq = 0;
                    arm.velocity = [0.0; JOINTS_MAX];
                });
            },
            end: mended,
        },
        Fault {
            what: "the arm's process was started anew",
            cause: StopCause::PlantBraked,
            category: One,
            noticed_within: 1,
            begin: |cell| {
                cell.arm.header.epoch += 1;
                cell.arm.position = cell::HOME;
                cell.arm.velocity = [0.0; JOINTS_MAX];
            },
            end: |_| {},
        },
        Fault {
            what: "something appears where the arm is",
            cause: StopCause::Clearance,
            category: Two,
            noticed_within: 11,
            begin: |cell| {
                let at = cell.tcp().translation.vector;
                let index = cell.scene.object_count as usize;
                cell.scene.objects[index] = SceneObject {
                    id: 60,
                    shape: Code::of(ShapeKind::Sphere),
                    size: [0.05, 0.0, 0.0],
                    base_from_object: Pose { position: at.into(), ..Pose::IDENTITY },
                };
                cell.scene.object_count += 1;
                cell.scene.version += 1;
            },
            end: |cell| {
                cell.scene.object_count -= 1;
                cell.scene.version += 1;
            },
        },
        Fault {
            what: "a person appears beside the arm",
            cause: StopCause::Separation,
            category: Two,
            noticed_within: 1,
            begin: |cell| {
                let at = cell.tcp().translation.vector;
                cell.person_at(at.x + 0.55, at.y + 0.2, [0.0; 3]);
            },
            end: |cell| cell.human.capsule_count = 0,
        },
    ]
}

fn under_way() -> Cell {
    let mut cell = Cell::with(tandem_controller::Params { resume_after_separation: false, ..cell::params() });
    cell.give(task(1, down(0.95, 0.50, 0.20, 0.0)));
    cell.until("under way", 5_000, |cell| cell.status().tcp_speed > 0.6);
    cell
}

/// Noticed in time, named, brought to rest without breaking a limit; stays while the cause lasts,
/// stays when it has gone, goes on after a reset, and the task is then completed.
#[test]
fn every_fault_stops_latches_and_can_be_reset() {
    for fault in faults() {
        let what = fault.what;
        let mut cell = under_way();
        (fault.begin)(&mut cell);
        let noticed = cell.until(what, 200, |cell| cell.stop() != StopState::Running);
        assert!(noticed <= fault.noticed_within, "{what}: {noticed} cycles");
        assert_eq!((cell.cause(), cell.status().category.get()), (fault.cause, Some(fault.category)), "{what}");
        assert_eq!(cell.status().stop_count, 1, "{what}");
        cell.until(what, 700, |cell| cell.stop() == StopState::Stopped);
        cell.run(5);
        assert!(!cell.moving(), "{what}");
        let brakes = u32::from(fault.category == StopCategory::One);
        assert_eq!(cell.outputs.command.brake, brakes, "{what}");
        let at = cell.arm.position;

        (fault.end)(&mut cell);
        cell.run(500);
        assert_eq!((cell.stop(), cell.cause()), (StopState::Stopped, fault.cause), "{what}: latched");
        for (joint, (now, then)) in cell.arm.position.iter().zip(&at).enumerate() {
            assert!((now - then).abs() < 0.11, "{what}: joint {joint} stays");
        }
        cell.task.reset_count += 1;
        cell.until(what, 50, |cell| cell.stop() == StopState::Running);
        assert_eq!(cell.status().reset_seen, cell.task.reset_count, "{what}");
        cell.until(what, 20_000, |cell| cell.phase() == MotionPhase::Done);
        assert_eq!(cell.status().stop_count, 1, "{what}");
        if fault.cause != StopCause::PlantBraked {
            // An arm that brakes by itself is mirrored, not commanded.
            cell.assert_limits();
        }
    }
}

/// While the cause lasts no number of resets moves the arm.
#[test]
fn a_reset_does_not_override_a_cause() {
    for fault in faults().into_iter().filter(|fault| {
        // These are events, over as soon as the arm stands: there is nothing left to refuse a reset for.
        !matches!(fault.cause, StopCause::TrackingError | StopCause::PlantBraked | StopCause::Clearance)
    }) {
        let mut cell = under_way();
        (fault.begin)(&mut cell);
        cell.until(fault.what, 700, |cell| cell.stop() == StopState::Stopped);
        cell.task.reset_count += 1;
        cell.run(300);
        assert_eq!(cell.stop(), StopState::Stopped, "{}", fault.what);
    }
}

/// A reset that came before the stop does not count for it.
#[test]
fn a_reset_is_not_stored() {
    let mut cell = under_way();
    cell.task.reset_count += 1;
    cell.run(20);
    cell.human_alive = false;
    cell.until("stopped", 700, |cell| cell.stop() == StopState::Stopped);
    cell.human_alive = true;
    cell.run(500);
    assert_eq!(cell.stop(), StopState::Stopped);
}

/// A controller that is started while the arm moves meets it where it is: position and velocity go on.
#[test]
fn a_new_controller_takes_over_a_moving_arm() {
    let mut cell = under_way();
    let command = cell.outputs.command;
    assert!(command.velocity.iter().any(|v| v.abs() > 0.3));
    cell.controller =
        tandem_controller::Controller::new(cell.chain, cell::body(), cell::params()).expect("the parameters pass");
    let mut last = command;
    for _ in 0..1_000 {
        cell.step();
        let next = cell.outputs.command;
        for joint in 0..6 {
            let step = next.position[joint] - last.position[joint];
            assert!((step - last.velocity[joint] * cell::PERIOD).abs() < 3e-3, "joint {joint} jumps by {step}");
        }
        last = next;
    }
    cell.until("done", 10_000, |cell| cell.phase() == MotionPhase::Done);
    assert_eq!(cell.status().stop_count, 0);
}

/// A new supervisor counts tasks and resets from the start; the same number is another task, and nothing jumps.
#[test]
fn a_new_supervisor_is_obeyed_from_standstill() {
    let mut cell = under_way();
    cell.task.header.epoch += 1;
    cell.scene.header.epoch += 1;
    let goal = down(0.35, -0.55, 0.20, 0.0);
    let header = cell.task.header;
    cell.task = MotionTask { header, ..task(1, goal) };
    cell.run(20);
    cell.until("done", 20_000, |cell| cell.phase() == MotionPhase::Done);
    assert!((cell.tcp().translation.vector.y + 0.55).abs() < 1e-5);
    assert_eq!(cell.status().stop_count, 0);
    cell.assert_limits();
}

/// Without any input the command asks for brakes; without a supervisor the arm is held where it is.
#[test]
fn silence_moves_nothing() {
    let mut cell = Cell::new();
    cell.arm_alive = false;
    cell.human_alive = false;
    cell.supervisor_alive = false;
    cell.run(50);
    assert_eq!((cell.outputs.command.brake, cell.cause()), (1, StopCause::ArmStale));
    cell.arm_alive = true;
    cell.run(50);
    assert_eq!((cell.outputs.command.brake, cell.cause()), (0, StopCause::HumanStale));
    assert_eq!(cell.outputs.command.position, cell::HOME);
    cell.human_alive = true;
    cell.run(50);
    assert_eq!(cell.cause(), StopCause::SupervisorStale);
    assert_eq!(cell.status().stop_count, 0);
    cell.supervisor_alive = true;
    cell.run(50);
    assert_eq!((cell.stop(), cell.cause()), (StopState::Running, StopCause::None));
    assert!(!cell.moving());
}

/// Every command says how long it may be acted on.
#[test]
fn commands_expire() {
    let mut cell = under_way();
    cell.run(10);
    assert_eq!(cell.outputs.command.valid_until, cell.now.after(cell::params().command_validity));
}
