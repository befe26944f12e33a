//! Where every part of the box truly is: the truth that perception has to find out.
//!
//! ```text
//! Store --Present--> Station --grasp--> Tool --seat, screw, press--> Product
//!                       |                |--release into a hand--> Person --> Product
//!                       '--a person takes it--> Person
//!                                        '--release over nothing--> Lost (falls; a spare may be presented)
//! ```
//!
//! Every part is a rigid body of the world with a box as its collider. On a
//! carrier and in the product it is fixed, in the tool its mass loads the arm's
//! last link, and only a part that was let go falls.

use nalgebra::{Isometry3, Vector3};
use rapier3d_f64::prelude::{ColliderBuilder, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle, RigidBodyType};
use tandem_msg::{Coded, EffectorAction, FeatureClass, Tool};

use super::arm::LinkMass;
use super::frames::{body_pose, from_body, vector};

/// A box with its centre in the part frame, axes parallel to it. Metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Block {
    pub(super) centre: [f64; 3],
    pub(super) half_extents: [f64; 3],
}

/// A part as the plant knows it.
#[derive(Clone, Debug)]
pub(super) struct PartModel {
    /// What its assembly feature truly is.
    pub(super) class: FeatureClass,
    /// Half of its bounding box, metres.
    pub(super) half_extents: [f64; 3],
    /// Boxes that cover it and leave its cavities open.
    pub(super) blocks: Vec<Block>,
    /// kg.
    pub(super) mass: f64,
    /// Index of the station that presents it.
    pub(super) station: usize,
    /// How it should lie there.
    pub(super) station_from_part: Isometry3<f64>,
    /// Where a tool takes it.
    pub(super) part_from_grasp: Isometry3<f64>,
    /// Where it belongs.
    pub(super) base_from_place: Isometry3<f64>,
    /// How far from its place it still slips in: metres, radians.
    pub(super) capture: (f64, f64),
    /// Width between the fingers when gripped, metres.
    pub(super) grasp_width: f64,
    /// Which tools can hold it, by the tool's code.
    pub(super) held_by: [bool; Tool::ALL.len()],
    /// Which actions join it, once it is in its place.
    pub(super) joined_by: Vec<EffectorAction>,
    /// Parts that must be in the product before it.
    pub(super) after: Vec<usize>,
}

/// Where a part is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// In the feeder.
    Store,
    /// On its carrier.
    Station,
    /// In the arm's tool.
    Tool,
    /// In a person's hands.
    Person,
    /// In the box, where it belongs.
    Product,
    /// Fell.
    Lost,
}

struct Item {
    model: PartModel,
    body: RigidBodyHandle,
    place: Place,
    base_from_part: Isometry3<f64>,
    tcp_from_part: Isometry3<f64>,
    secured: bool,
}

/// All parts of one box.
pub(super) struct Parts {
    items: Vec<Item>,
    held: Option<usize>,
}

impl Parts {
    /// Every part in the feeder.
    pub(super) fn new(models: Vec<PartModel>, world: &mut PhysicsWorld) -> Self {
        let items = models
            .into_iter()
            .map(|model| {
                let body = world.insert_body(RigidBodyBuilder::fixed().enabled(false));
                let share = model.mass / model.blocks.len().max(1) as f64;
                for block in &model.blocks {
                    let [x, y, z] = block.half_extents;
                    let centre = vector(&block.centre.into());
                    world.insert_collider(
                        ColliderBuilder::cuboid(x, y, z).translation(centre).mass(share).friction(0.6),
                        Some(body),
                    );
                }
                let away = Isometry3::identity();
                Item { model, body, place: Place::Store, base_from_part: away, tcp_from_part: away, secured: false }
            })
            .collect();
        Self { items, held: None }
    }

    /// How many part types a box has.
    pub(super) fn count(&self) -> usize {
        self.items.len()
    }

    /// The description of a part.
    pub(super) fn model(&self, part: usize) -> Option<&PartModel> {
        self.items.get(part).map(|item| &item.model)
    }

    /// Where a part is; an unknown part is in the feeder for ever.
    pub(super) fn place(&self, part: usize) -> Place {
        self.items.get(part).map_or(Place::Store, |item| item.place)
    }

    /// The true pose of a part.
    pub(super) fn base_from_part(&self, part: usize) -> Isometry3<f64> {
        self.items.get(part).map_or_else(Isometry3::identity, |item| item.base_from_part)
    }

    /// The part in the tool.
    pub(super) fn held(&self) -> Option<usize> {
        self.held
    }

    /// How many parts are where the product file wants them.
    pub(super) fn seated(&self) -> u32 {
        self.items.iter().filter(|item| item.place == Place::Product).count() as u32
    }

    /// Whether all parts that come before this one are in the product.
    pub(super) fn ready_for(&self, part: usize) -> bool {
        self.model(part).is_some_and(|model| model.after.iter().all(|&p| self.place(p) == Place::Product))
    }

    /// The part whose grasp frame is nearest the tool centre point, within the
    /// tolerance (metres, radians), among those on a carrier.
    pub(super) fn within_grasp(&self, base_from_tcp: &Isometry3<f64>, tolerance: (f64, f64)) -> Option<usize> {
        let mut best = None;
        for (index, item) in self.items.iter().enumerate() {
            if item.place != Place::Station {
                continue;
            }
            let (metres, radians) =
                super::frames::apart(base_from_tcp, &(item.base_from_part * item.model.part_from_grasp));
            if metres <= tolerance.0 && radians <= tolerance.1 && best.is_none_or(|(_, nearest)| metres < nearest) {
                best = Some((index, metres));
            }
        }
        best.map(|(index, _)| index)
    }

    /// Puts every part but a held one back into the feeder: the next box begins.
    pub(super) fn clear(&mut self, world: &mut PhysicsWorld) {
        for index in 0..self.items.len() {
            if self.items[index].place != Place::Tool {
                self.settle(world, index, Place::Store, RigidBodyType::Fixed);
            }
        }
    }

    /// Sets a part on its carrier.
    pub(super) fn present(&mut self, world: &mut PhysicsWorld, part: usize, base_from_part: Isometry3<f64>) {
        self.items[part].base_from_part = base_from_part;
        self.settle(world, part, Place::Station, RigidBodyType::Fixed);
    }

    /// The tool takes a part as it lies, error and all.
    pub(super) fn take_with_tool(&mut self, world: &mut PhysicsWorld, part: usize, base_from_tcp: &Isometry3<f64>) {
        self.items[part].tcp_from_part = base_from_tcp.inverse() * self.items[part].base_from_part;
        self.settle(world, part, Place::Tool, RigidBodyType::Fixed);
        self.held = Some(part);
    }

    /// A person takes a part, from wherever it is.
    pub(super) fn take_by_hand(&mut self, world: &mut PhysicsWorld, part: usize) {
        self.settle(world, part, Place::Person, RigidBodyType::Fixed);
    }

    /// The part goes home: into the product, exactly where it belongs.
    pub(super) fn seat(&mut self, world: &mut PhysicsWorld, part: usize) {
        self.items[part].base_from_part = self.items[part].model.base_from_place;
        self.settle(world, part, Place::Product, RigidBodyType::Fixed);
    }

    /// A person has fastened a part that the tool still holds: let go of, it stays in the product.
    pub(super) fn secure(&mut self, part: usize) {
        if self.place(part) == Place::Tool {
            self.items[part].secured = true;
        }
    }

    /// Whether [`Parts::secure`] was said of the part since it was taken.
    pub(super) fn secured(&self, part: usize) -> bool {
        self.items.get(part).is_some_and(|item| item.secured)
    }

    /// The part falls from where it is, at `velocity` m/s.
    pub(super) fn fall(&mut self, world: &mut PhysicsWorld, part: usize, velocity: &Vector3<f64>) {
        self.settle(world, part, Place::Lost, RigidBodyType::Dynamic);
        if let Some(body) = world.bodies.get_mut(self.items[part].body) {
            body.set_linvel(vector(velocity), true);
        }
    }

    fn settle(&mut self, world: &mut PhysicsWorld, part: usize, place: Place, kind: RigidBodyType) {
        let item = &mut self.items[part];
        item.place = place;
        item.secured = false;
        if self.held == Some(part) {
            self.held = None;
        }
        if let Some(body) = world.bodies.get_mut(item.body) {
            body.set_body_type(kind, true);
            body.set_linvel(Default::default(), false);
            body.set_angvel(Default::default(), false);
            body.set_position(body_pose(&item.base_from_part), true);
            body.set_enabled(matches!(place, Place::Station | Place::Product | Place::Lost));
        }
    }

    /// Lets what is carried follow its carrier, and what falls be where it fell.
    pub(super) fn follow(&mut self, world: &PhysicsWorld, base_from_tcp: &Isometry3<f64>, hand: &Vector3<f64>) {
        for item in &mut self.items {
            match item.place {
                Place::Tool => item.base_from_part = base_from_tcp * item.tcp_from_part,
                Place::Person => item.base_from_part.translation.vector = *hand,
                Place::Lost => {
                    if let Some(body) = world.bodies.get(item.body) {
                        item.base_from_part = from_body(body.position());
                    }
                }
                Place::Store | Place::Station | Place::Product => {}
            }
        }
    }

    /// Whether a part is on its way down.
    pub(super) fn falling(&self, world: &PhysicsWorld) -> bool {
        let awake = |item: &Item| world.bodies.get(item.body).is_some_and(|body| !body.is_sleeping());
        self.items.iter().any(|item| item.place == Place::Lost && awake(item))
    }

    /// What the held part adds to the arm's last link, in that link's frame.
    pub(super) fn load(&self, flange_from_tcp: &Isometry3<f64>) -> Option<LinkMass> {
        let item = self.items.get(self.held?)?;
        let flange_from_part = flange_from_tcp * item.tcp_from_part;
        Some(LinkMass::of_box(item.model.mass, item.model.half_extents, &flange_from_part))
    }
}
