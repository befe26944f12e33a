//! Where things are and where they go: poses of parts and tool, and the scene as the arm must know it.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use tandem_config::{Cell, Part, id, pose_of};
use tandem_msg::{AttachedPart, Code, Pose, SCENE_OBJECTS_MAX, Scene, SceneObject, ShapeKind};

/// Half width of the column above the TCP that a tool may fill, metres.
const TOOL_HALF_WIDTH: f64 = 0.07;
/// Height of that column, metres.
const TOOL_HEIGHT: f64 = 0.30;
/// Things nearer than this to a part on its way into its place may be touched, metres.
const NEAR: f64 = 0.03;

/// Where the TCP is when a part sits in its place.
pub(super) fn tcp_at_place(cell: &Cell, part: &Part) -> Isometry3<f64> {
    cell.layout.base_from_fixture * part.fixture_from_part * part.part_from_grasp
}

/// Where a part nominally lies at its station.
pub(super) fn nominal_at_station(cell: &Cell, part: &Part) -> Isometry3<f64> {
    cell.layout.stations[part.station].base_from_station * part.station_from_part
}

/// `distance` straight back from a goal.
pub(super) fn back_from(base_from_tcp: &Isometry3<f64>, distance: f64) -> Isometry3<f64> {
    base_from_tcp * Translation3::new(0.0, 0.0, -distance)
}

/// A part as the tool carries it.
pub(super) fn attached(part: &Part) -> AttachedPart {
    AttachedPart {
        present: 1,
        shape: 0,
        half_extents: part.half_extents,
        tcp_from_part: pose_of(&part.part_from_grasp.inverse()),
        mass: part.mass,
    }
}

/// An upright box around something, in base axes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Span {
    fn around(base_from_box: &Isometry3<f64>, half_extents: [f64; 3]) -> Self {
        let turned = base_from_box.rotation.to_rotation_matrix().matrix().abs() * Vector3::from(half_extents);
        let centre = base_from_box.translation.vector;
        Self { low: centre - turned, high: centre + turned }
    }

    /// Smallest distance along any axis between the two; negative when they overlap.
    fn gap(&self, other: &Self) -> f64 {
        (0..3)
            .map(|axis| (self.low[axis] - other.high[axis]).max(other.low[axis] - self.high[axis]))
            .fold(f64::NEG_INFINITY, f64::max)
    }
}

/// The scene: what never moves, the part that is presented, and the parts in the box.
#[derive(Clone, Debug)]
pub(super) struct Surveyed {
    fixed: Vec<SceneObject>,
    presented: Option<SceneObject>,
    placed: Vec<SceneObject>,
    version: u64,
}

fn solid(id: u32, base_from_part: &Isometry3<f64>, part: &Part) -> SceneObject {
    SceneObject {
        id,
        shape: Code::of(ShapeKind::Box),
        size: part.half_extents,
        base_from_object: pose_of(base_from_part),
    }
}

impl Surveyed {
    pub(super) fn new(cell: &Cell) -> Self {
        Self { fixed: cell.layout.scene_objects(), presented: None, placed: Vec::new(), version: 1 }
    }

    pub(super) fn version(&self) -> u64 {
        self.version
    }

    /// An empty fixture.
    pub(super) fn clear_box(&mut self) {
        self.placed.clear();
        self.presented = None;
        self.version += 1;
    }

    /// A part lies at its station.
    pub(super) fn present(&mut self, base_from_part: &Isometry3<f64>, part: &Part) {
        self.presented = Some(solid(id::PRESENTED, base_from_part, part));
        self.version += 1;
    }

    /// The part has left its station.
    pub(super) fn taken(&mut self) {
        if self.presented.take().is_some() {
            self.version += 1;
        }
    }

    /// A part sits in its place.
    pub(super) fn place(&mut self, index: usize, part: &Part, cell: &Cell) {
        let base_from_part = cell.layout.base_from_fixture * part.fixture_from_part;
        self.presented = None;
        self.placed.push(solid(id::PLACED + index as u32, &base_from_part, part));
        self.version += 1;
    }

    /// The scene as a message. The placed parts come last and the array has room for
    /// every part a product may have (checked when the cell is read).
    pub(super) fn write(&self, scene: &mut Scene) {
        scene.version = self.version;
        let all = self.fixed.iter().chain(&self.presented).chain(&self.placed);
        let mut count = 0;
        for (slot, object) in scene.objects.iter_mut().zip(all) {
            *slot = *object;
            count += 1;
        }
        for slot in &mut scene.objects[count.min(SCENE_OBJECTS_MAX)..] {
            *slot = SceneObject::default();
        }
        scene.object_count = count as u32;
    }

    /// What a part and its tool may touch on the way into its place from `hover` above:
    /// the fixture, and the nearest of the parts that already sit there.
    pub(super) fn touch_at_place(&self, cell: &Cell, part: &Part, hover: f64) -> [u32; 8] {
        let base_from_part = cell.layout.base_from_fixture * part.fixture_from_part;
        let mut swept = Span::around(&base_from_part, part.half_extents);
        swept.high.z += hover;
        let tcp = Point3::from((base_from_part * part.part_from_grasp).translation.vector);
        let wide = Vector3::new(TOOL_HALF_WIDTH, TOOL_HALF_WIDTH, 0.0);
        let column = Span { low: tcp.coords - wide, high: tcp.coords + wide + Vector3::new(0.0, 0.0, TOOL_HEIGHT) };

        let mut near: Vec<(f64, u32)> = self
            .placed
            .iter()
            .filter_map(|object| {
                let base_from_object = tandem_config::isometry_of(&object.base_from_object)?;
                let span = Span::around(&base_from_object, object.size);
                let gap = span.gap(&swept).min(span.gap(&column));
                (gap < NEAR).then_some((gap, object.id))
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        touch(std::iter::once(id::FIXTURE).chain(near.into_iter().map(|(_, id)| id)))
    }
}

/// The first eight of these ids.
pub(super) fn touch(ids: impl IntoIterator<Item = u32>) -> [u32; 8] {
    let mut out = [0; 8];
    for (slot, id) in out.iter_mut().zip(ids) {
        *slot = id;
    }
    out
}

/// Where a part is when the TCP holds it at this pose.
pub(super) fn part_at(base_from_tcp: &Isometry3<f64>, part: &Part) -> Pose {
    pose_of(&(base_from_tcp * part.part_from_grasp.inverse()))
}
