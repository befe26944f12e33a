//! Where the arm may be: walls in the base frame that no link and no carried part may pass.
//!
//! A wall is handed to the clearance monitors as an object of the scene, a block
//! behind it. So the planner, the sweep of every stop and the check of every
//! set-point keep away from it as from anything else, and what is too near to a
//! wall has its own stop cause.

use tandem_msg::{Code, Pose, SCENE_OBJECTS_MAX, Scene, SceneObject, ShapeKind};

/// Walls a workspace has room for.
pub const WALLS_MAX: usize = 12;
/// Ids from here on are walls.
const FIRST_ID: u32 = u32::MAX - WALLS_MAX as u32 + 1;
/// Half extents of the block behind a wall, metres: more than any arm reaches.
const HALF: f64 = 20.0;

/// One wall: a plane with the arm on one side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wall {
    /// A point of it, base frame, metres.
    pub point: [f64; 3],
    /// Unit vector into the workspace.
    pub inwards: [f64; 3],
}

/// The walls around an arm; none leaves it all the room there is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Workspace {
    walls: [Wall; WALLS_MAX],
    count: usize,
}

impl Workspace {
    /// A workspace of these walls; `None` when there are too many, or one has no place or no direction.
    pub fn new(walls: &[Wall]) -> Option<Self> {
        let mut space = Self::default();
        for wall in walls {
            let length = wall.inwards.iter().map(|x| x * x).sum::<f64>().sqrt();
            let placed = wall.point.iter().all(|x| x.abs() <= HALF) && length > 1e-9 && length.is_finite();
            if !placed || space.count >= WALLS_MAX {
                return None;
            }
            space.walls[space.count] = Wall { point: wall.point, inwards: wall.inwards.map(|x| x / length) };
            space.count += 1;
        }
        Some(space)
    }

    /// A box along the base axes, from its least to its greatest corner, metres.
    pub fn within(min: [f64; 3], max: [f64; 3]) -> Option<Self> {
        let mut walls = [Wall::default(); 6];
        for axis in 0..3 {
            if !(min[axis] < max[axis]) {
                return None;
            }
            (walls[2 * axis].point, walls[2 * axis + 1].point) = (min, max);
            walls[2 * axis].inwards[axis] = 1.0;
            walls[2 * axis + 1].inwards[axis] = -1.0;
        }
        Self::new(&walls)
    }

    /// With the walls of another one as well; `None` when they are too many.
    pub fn and(&self, other: &[Wall]) -> Option<Self> {
        let mut space = Self::new(other)?;
        for wall in self.walls() {
            *space.walls.get_mut(space.count)? = *wall;
            space.count += 1;
        }
        Some(space)
    }

    /// The walls.
    pub fn walls(&self) -> &[Wall] {
        &self.walls[..self.count.min(WALLS_MAX)]
    }

    /// Whether an object of a scene is one of the walls.
    pub(crate) fn is_wall(id: u32) -> bool {
        id >= FIRST_ID
    }

    /// The objects of a scene with the walls around them, and their count; `None` when there is no room left.
    pub(crate) fn enclose(&self, scene: &Scene) -> Option<([SceneObject; SCENE_OBJECTS_MAX], usize)> {
        let mut objects = scene.objects;
        let mut count = scene.objects().len();
        for (wall, id) in self.walls().iter().zip(FIRST_ID..) {
            *objects.get_mut(count)? = block(wall, id);
            count += 1;
        }
        Some((objects, count))
    }
}

/// The block behind a wall: its z axis points into the workspace.
fn block(wall: &Wall, id: u32) -> SceneObject {
    let [x, y, z] = wall.inwards;
    // Turns z into the wall's direction about the axis across both; straight down it is half a turn about x.
    let rotation = if z > -1.0 + 1e-9 {
        let scale = 1.0 / (2.0 * (1.0 + z)).sqrt();
        [-y * scale, x * scale, 0.0, 0.5 / scale]
    } else {
        [1.0, 0.0, 0.0, 0.0]
    };
    let position = core::array::from_fn(|axis| wall.point[axis] - HALF * wall.inwards[axis]);
    SceneObject {
        id,
        shape: Code::of(ShapeKind::Box),
        size: [2.0 * HALF, 2.0 * HALF, HALF],
        base_from_object: Pose { position, rotation },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The block's face goes through the wall's point, across its direction, whatever that is.
    #[test]
    fn a_block_ends_at_its_wall() {
        let directions =
            [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.48, -0.64, 0.6]];
        for inwards in directions {
            let object = block(&Wall { point: [0.3, -0.2, 0.5], inwards }, 9);
            assert!(object.base_from_object.is_valid(), "{inwards:?}");
            let turn = crate::job::isometry(&object.base_from_object);
            let face = turn * nalgebra::Point3::new(0.0, 0.0, HALF);
            for (axis, expected) in [0.3, -0.2, 0.5].into_iter().enumerate() {
                assert!((face[axis] - expected).abs() < 1e-9, "{inwards:?}: {face}");
                assert!(((turn.rotation * nalgebra::Vector3::z())[axis] - inwards[axis]).abs() < 1e-9, "{inwards:?}");
            }
        }
    }

    /// What is no wall, or too many of them, is refused; a scene that is full has no room for walls.
    #[test]
    fn what_is_no_workspace_is_refused() {
        let wall = Wall { point: [0.0; 3], inwards: [0.0, 0.0, 2.0] };
        assert_eq!(Workspace::new(&[wall]).map(|space| space.walls()[0].inwards), Some([0.0, 0.0, 1.0]));
        assert_eq!(Workspace::new(&[Wall { inwards: [0.0; 3], ..wall }]), None);
        assert_eq!(Workspace::new(&[Wall { inwards: [f64::NAN; 3], ..wall }]), None);
        assert_eq!(Workspace::new(&[Wall { point: [f64::INFINITY; 3], ..wall }]), None);
        assert_eq!(Workspace::new(&[wall; WALLS_MAX + 1]), None);
        assert_eq!(Workspace::within([0.0; 3], [1.0, 0.0, 1.0]), None);
        let room = Workspace::within([-1.0; 3], [1.0; 3]).expect("a box");
        assert_eq!(room.and(&[wall; 6]).map(|space| space.walls().len()), Some(12));
        assert_eq!(room.and(&[wall; 7]), None);
        let mut scene = Scene { object_count: SCENE_OBJECTS_MAX as u32 - 6, ..Scene::default() };
        assert_eq!(room.enclose(&scene).map(|(_, count)| count), Some(SCENE_OBJECTS_MAX));
        scene.object_count += 1;
        assert!(room.enclose(&scene).is_none());
    }
}
