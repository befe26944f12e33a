//! Tools, parts, feeder and camera.

use super::*;

/// A grasp closes where the part truly is, and nowhere else.
#[test]
fn a_grasp_needs_the_part_where_the_tool_is() {
    let cases = [
        (0.0, 0.0, Tool::ParallelGripper, EffectorPhase::Done),
        (0.008, 0.08, Tool::ParallelGripper, EffectorPhase::Done),
        (0.014, 0.0, Tool::ParallelGripper, EffectorPhase::Failed),
        (0.0, 0.15, Tool::ParallelGripper, EffectorPhase::Failed),
        // A cable is no flat face, and has no thread.
        (0.0, 0.0, Tool::VacuumGripper, EffectorPhase::Failed),
        (0.0, 0.0, Tool::Screwdriver, EffectorPhase::Failed),
    ];
    for (metres, radians, tool, phase) in cases {
        let mut rig = Rig::new(5);
        let part = rig.part("main_cable");
        rig.couple(tool);
        assert_eq!(rig.ask(RequestKind::Present, part), Some(RequestPhase::Served));
        rig.tcp_to(&shifted(&rig.true_grasp(part), metres, radians));
        assert_eq!(rig.act(EffectorAction::Grasp, Tool::None), Some(phase), "{metres} m {radians} rad {tool}");
        assert_eq!(rig.out.arm.effector.holding == 1, phase == EffectorPhase::Done);
        let place = if phase == EffectorPhase::Done { Place::Tool } else { Place::Station };
        assert_eq!(rig.plant.parts.place(part), place);
        if tool == rig.cell.layout.initial_tool {
            // Changing the tool in joint space, as this rig does, may brush the rack's neighbours.
            assert_eq!(rig.out.cell.contacts, 0, "{metres} m {radians} rad {tool}");
        }
    }
}

/// A part goes home within its capture range, by the action that fits its feature, in order.
#[test]
fn a_part_goes_home_only_as_it_should() {
    let cases = [
        ("heat_guard_plate", Tool::ParallelGripper, EffectorAction::Seat, 0.004, EffectorPhase::Done),
        ("heat_guard_plate", Tool::ParallelGripper, EffectorAction::Seat, 0.009, EffectorPhase::Failed),
        ("heat_guard_plate", Tool::ParallelGripper, EffectorAction::Press, 0.0, EffectorPhase::Failed),
        ("fuse", Tool::Screwdriver, EffectorAction::Screw, 0.0, EffectorPhase::Done),
        ("fuse", Tool::ParallelGripper, EffectorAction::Seat, 0.0, EffectorPhase::Failed),
        ("fireproof_guard_plate", Tool::PressTool, EffectorAction::Press, 0.0, EffectorPhase::Done),
    ];
    for (name, tool, action, off, phase) in cases {
        let mut rig = Rig::new(6);
        let part = rig.take(name, tool);
        let seated = rig.out.cell.parts_seated;
        let place = shifted(&rig.home_of(part), off, 0.0);
        rig.tcp_to(&rig.tcp_for(part, &place));
        assert_eq!(rig.act(action, Tool::None), Some(phase), "{name} {action} {off}");
        let done = phase == EffectorPhase::Done;
        assert_eq!(rig.plant.parts.place(part), if done { Place::Product } else { Place::Tool }, "{name} {action}");
        assert_eq!(rig.out.cell.parts_seated, seated + u32::from(done));
    }
    let mut rig = Rig::new(6);
    let part = rig.take("heat_guard_plate", Tool::ParallelGripper);
    rig.plant.parts.take_by_hand(&mut rig.plant.world, part - 1);
    rig.tcp_to(&rig.tcp_for(part, &rig.home_of(part)));
    assert_eq!(rig.act(EffectorAction::Seat, Tool::None), Some(EffectorPhase::Failed), "nothing below it");
}

/// Let go of over nothing, a part falls to the bench and is lost; a spare may be presented.
#[test]
fn a_part_let_go_of_falls() {
    let mut rig = Rig::new(7);
    let part = rig.take("heat_guard_plate", Tool::ParallelGripper);
    let up = Isometry3::translation(0.1, 0.25, 0.25) * rig.plant.base_from_tcp;
    rig.tcp_to(&up);
    assert_eq!(rig.act(EffectorAction::Release, Tool::None), Some(EffectorPhase::Done));
    assert_eq!((rig.out.arm.effector.holding, rig.plant.parts.place(part)), (0, Place::Lost));
    rig.cycles(1_500);
    let rests = rig.plant.parts.base_from_part(part).translation.vector;
    assert!(rests.z > -0.01 && rests.z < 0.12, "it lies on something: {rests}");
    assert_eq!(rig.ask(RequestKind::Present, part), Some(RequestPhase::Served));
}

/// A tool couples only at its own place of the rack, and only to a bare flange.
#[test]
fn tools_change_only_at_their_place() {
    let mut rig = Rig::new(8);
    assert!(rig.out.arm.effector.tool.is(rig.cell.layout.initial_tool));
    assert_eq!(rig.act(EffectorAction::DetachTool, Tool::ParallelGripper), Some(EffectorPhase::Failed));
    rig.tcp_to_rack(Tool::Screwdriver);
    assert_eq!(rig.act(EffectorAction::DetachTool, Tool::ParallelGripper), Some(EffectorPhase::Failed));
    rig.tcp_to_rack(Tool::ParallelGripper);
    assert_eq!(rig.act(EffectorAction::AttachTool, Tool::ParallelGripper), Some(EffectorPhase::Failed));
    assert_eq!(rig.act(EffectorAction::DetachTool, Tool::ParallelGripper), Some(EffectorPhase::Done));
    assert_eq!(rig.act(EffectorAction::AttachTool, Tool::Screwdriver), Some(EffectorPhase::Failed));
    rig.tcp_to_rack(Tool::Screwdriver);
    assert_eq!(rig.act(EffectorAction::AttachTool, Tool::Screwdriver), Some(EffectorPhase::Done));
    assert!(rig.out.arm.effector.tool.is(Tool::Screwdriver));
}

/// The feeder serves what it can: scans once per request, and refuses what makes no sense.
#[test]
fn the_feeder_answers_every_request() {
    let mut rig = Rig::new(9);
    assert_eq!(rig.ask(RequestKind::Rescan, 0), Some(RequestPhase::Failed), "nothing to scan");
    assert_eq!(rig.ask(RequestKind::NewBox, 0), Some(RequestPhase::Served));
    assert_eq!(rig.ask(RequestKind::Present, 99), Some(RequestPhase::Failed), "no such part");
    assert_eq!(rig.ask(RequestKind::Present, 0), Some(RequestPhase::Served));
    rig.cycles(1_000);
    assert_eq!(rig.scans, 1);
    assert_eq!(rig.ask(RequestKind::Rescan, 0), Some(RequestPhase::Served));
    rig.cycles(1_000);
    assert_eq!(rig.scans, 2);
    rig.plant.parts.seat(&mut rig.plant.world, 0);
    assert_eq!(rig.ask(RequestKind::Present, 0), Some(RequestPhase::Failed), "it is in the box");
    assert_eq!(rig.ask(RequestKind::NewBox, 0), Some(RequestPhase::Served));
    assert_eq!(rig.out.cell.parts_seated, 0);
    assert_eq!(rig.ask(RequestKind::Present, 0), Some(RequestPhase::Served));
}

/// A scan shows the part that is there, to the request that asked for it, and nothing when none is.
#[test]
fn the_camera_sees_the_presented_part() {
    let mut rig = Rig::new(9);
    let mut cloud = Box::new(PointCloud::default());
    rig.plant.scan(&mut cloud);
    assert_eq!((cloud.request, cloud.point_count), (0, 0));
    for part in 0..rig.cell.product.parts.len() {
        rig.plant.parts.clear(&mut rig.plant.world);
        assert_eq!(rig.ask(RequestKind::Present, part), Some(RequestPhase::Served));
        rig.cycles(500);
        rig.plant.scan(&mut cloud);
        assert_eq!(cloud.request, rig.request.id);
        assert!(cloud.point_count > 5_000, "part {part}: {} points", cloud.point_count);
    }
}
