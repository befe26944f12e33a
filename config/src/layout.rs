//! What stands where in the cell.

use crate::camera::Camera;
use crate::pose::pose_of;
use crate::read::{Bound, Table, bound};
use nalgebra::{Isometry3, Translation3};
use tandem_msg::{Code, Coded, SceneObject, ShapeKind, Tool};

/// Identities of scene objects, as they appear in [`SceneObject::id`] and `MotionTask::touch`.
pub mod id {
    /// First of the fixed objects (bench first); they count up from here.
    pub const FIXED: u32 = 1;
    /// Plate of the fixture.
    pub const FIXTURE: u32 = 20;
    /// Carrier of the first station; they count up from here.
    pub const STATION: u32 = 30;
    /// The tool rack.
    pub const RACK: u32 = 40;
    /// The part that lies at a station.
    pub const PRESENTED: u32 = 50;
    /// The first part type of the product, when it sits in the box; they count up from here.
    pub const PLACED: u32 = 100;
}

const SIZE: Bound = bound("size_m", "m", 0.001, 5.0);
const ABOVE: Bound = bound("approach_m", "m", 0.02, 0.4);
const FLOOR: Bound = bound("floor_z_m", "m", -3.0, 0.0);

/// A box that never moves.
#[derive(Clone, Debug, PartialEq)]
pub struct FixedObject {
    /// Its name in the cell file.
    pub name: String,
    /// Its identity in the scene.
    pub id: u32,
    /// Half extents, metres.
    pub half_extents: [f64; 3],
    /// Where its centre stands.
    pub base_from_object: Isometry3<f64>,
}

impl FixedObject {
    /// A box whose top face has its centre at `base_from_top`.
    fn below(name: String, id: u32, half_extents: [f64; 3], base_from_top: &Isometry3<f64>) -> Self {
        let base_from_object = base_from_top * Translation3::new(0.0, 0.0, -half_extents[2]);
        Self { name, id, half_extents, base_from_object }
    }

    /// The object as it stands in a scene.
    pub fn scene_object(&self) -> SceneObject {
        SceneObject {
            id: self.id,
            shape: Code::of(ShapeKind::Box),
            size: self.half_extents,
            base_from_object: pose_of(&self.base_from_object),
        }
    }
}

/// A place where parts arrive on a carrier.
#[derive(Clone, Debug, PartialEq)]
pub struct Station {
    /// Its name; parts refer to it.
    pub name: String,
    /// Centre of the carrier's top face, z up.
    pub base_from_station: Isometry3<f64>,
    /// The carrier.
    pub carrier: FixedObject,
}

/// A place of the tool rack.
#[derive(Clone, Debug, PartialEq)]
pub struct RackSlot {
    /// The tool that lives there.
    pub tool: Tool,
    /// Where the TCP is when flange and tool couple; z is the approach direction.
    pub base_from_tcp: Isometry3<f64>,
}

/// What stands where; every pose in the frame of the robot's base.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Layout {
    /// Height of the floor a person stands on, metres.
    pub floor_z: f64,
    /// Bench and whatever else never moves, in the order of the file.
    pub fixed: Vec<FixedObject>,
    /// Centre of the fixture's top face: the frame the box grows in, z up.
    pub base_from_fixture: Isometry3<f64>,
    /// The plate below it.
    pub fixture: FixedObject,
    /// Stations, in the order of the file.
    pub stations: Vec<Station>,
    /// The rack as an obstacle.
    pub rack: FixedObject,
    /// Its places, one a tool.
    pub rack_slots: Vec<RackSlot>,
    /// Straight way out of and into a rack place, metres.
    pub rack_approach: f64,
    /// Tool that is coupled when the cell starts.
    pub initial_tool: Tool,
    /// TCP pose at which a part is offered to a person.
    pub base_from_handover: Isometry3<f64>,
    /// TCP pose at which a part is held for a person to work on it.
    pub base_from_hold: Isometry3<f64>,
    /// The depth camera.
    pub camera: Camera,
}

impl Layout {
    /// Everything that never moves, as it stands in a scene.
    pub fn scene_objects(&self) -> Vec<SceneObject> {
        let carriers = self.stations.iter().map(|station| &station.carrier);
        self.fixed
            .iter()
            .chain([&self.fixture])
            .chain(carriers)
            .chain([&self.rack])
            .map(FixedObject::scene_object)
            .collect()
    }

    /// The rack place of a tool.
    pub fn rack_slot(&self, tool: Tool) -> Option<&RackSlot> {
        self.rack_slots.iter().find(|slot| slot.tool == tool)
    }

    /// Index of the station of that name.
    pub fn station(&self, name: &str) -> Option<usize> {
        self.stations.iter().position(|station| station.name == name)
    }

    pub(crate) fn read(cell: &Table<'_>) -> Option<Self> {
        let table = cell.table("layout")?;
        let half = |table: &Table<'_>| table.numbers::<3>(&SIZE).map(|extent| extent / 2.0);

        let mut fixed: Vec<FixedObject> = Vec::new();
        for object in table.tables("object") {
            let name = object.text("name").unwrap_or_default();
            if fixed.iter().any(|known| known.name == name) {
                object.refuse("name", &format!("\"{name}\""), "a name used once", "give each object its own name");
            }
            fixed.push(FixedObject {
                name,
                id: id::FIXED + fixed.len() as u32,
                half_extents: half(&object),
                base_from_object: object.own_pose(),
            });
        }
        if fixed.len() > 12 {
            let found = format!("{} objects", fixed.len());
            table.refuse("object", &found, "at most 12 objects", "join neighbouring objects into one box");
        }

        let fixture = table.table("fixture")?;
        let base_from_fixture = fixture.own_pose();
        let fixture = FixedObject::below("fixture".into(), id::FIXTURE, half(&fixture), &base_from_fixture);

        let mut stations: Vec<Station> = Vec::new();
        for station in table.tables("station") {
            let name = station.text("name").unwrap_or_default();
            if stations.iter().any(|known| known.name == name) {
                station.refuse("name", &format!("\"{name}\""), "a name used once", "give each station its own name");
            }
            let base_from_station = station.own_pose();
            let carrier_id = id::STATION + stations.len() as u32;
            let carrier = FixedObject::below(name.clone(), carrier_id, half(&station), &base_from_station);
            stations.push(Station { name, base_from_station, carrier });
        }
        if stations.is_empty() || stations.len() > 8 {
            let found = format!("{} stations", stations.len());
            table.refuse(
                "station",
                &found,
                "1..=8 stations",
                "write one [[layout.station]] a place where parts arrive",
            );
        }

        let rack_table = table.table("rack")?;
        let rack = FixedObject::below("rack".into(), id::RACK, half(&rack_table), &rack_table.own_pose());
        let rack_approach = rack_table.number(&ABOVE);
        let mut rack_slots: Vec<RackSlot> = Vec::new();
        for slot in rack_table.tables("slot") {
            let Some(tool) = slot.named::<Tool>("tool") else {
                continue;
            };
            if tool == Tool::None || rack_slots.iter().any(|known| known.tool == tool) {
                let found = format!("\"{tool}\"");
                slot.refuse("tool", &found, "each of the four tools once", "give each tool one place");
            }
            rack_slots.push(RackSlot { tool, base_from_tcp: slot.own_pose() });
        }
        for &tool in Tool::ALL.iter().filter(|tool| **tool != Tool::None) {
            if !rack_slots.iter().any(|slot| slot.tool == tool) {
                let found = format!("no place for {tool}");
                rack_table.refuse("slot", &found, "each of the four tools once", "add a [[layout.rack.slot]] for it");
            }
        }

        Some(Self {
            floor_z: table.number(&FLOOR),
            fixed,
            base_from_fixture,
            fixture,
            stations,
            rack,
            rack_slots,
            rack_approach,
            initial_tool: table.named_if("initial_tool").unwrap_or(Tool::None),
            base_from_handover: table.pose("handover"),
            base_from_hold: table.pose("hold"),
            camera: Camera::read(&table),
        })
    }
}
