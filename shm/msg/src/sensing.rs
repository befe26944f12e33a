//! What the cell sees: clouds, people, recognised features.

use crate::coded::coded;
use crate::header::message;
use crate::{CLOUD_POINTS, Capsule, Code, FEATURE_CLASSES, HUMAN_CAPSULES_MAX, Header, Pose};

/// One scan of the presented part, plant to perception. 120 kB: travels by loan.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct PointCloud {
    /// Header.
    pub header: Header,
    /// `CellRequest::id` of the request that presented the part; 0 when nothing is presented.
    pub request: u32,
    /// Points in use, the first of the array.
    pub point_count: u32,
    /// Where the camera stands.
    pub base_from_camera: Pose,
    /// Points: N×3, metres, in the camera frame (z along the view).
    pub points: [[f32; 3]; CLOUD_POINTS],
}
message!(PointCloud, 120_096);

impl Default for PointCloud {
    fn default() -> Self {
        Self {
            header: Header::default(),
            request: 0,
            point_count: 0,
            base_from_camera: Pose::IDENTITY,
            points: [[0.0; 3]; CLOUD_POINTS],
        }
    }
}

coded! {
    /// Parts of the body, for the separation each is owed.
    pub enum BodyPart {
        /// Trunk and hips.
        Torso = 0, "torso";
        /// Head and neck.
        Head = 1, "head";
        /// Upper arm.
        UpperArm = 2, "upper_arm";
        /// Forearm.
        Forearm = 3, "forearm";
        /// Hand.
        Hand = 4, "hand";
        /// Leg.
        Leg = 5, "leg";
    }
}

/// The tracked person, plant to controller and supervisor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct HumanState {
    /// Header.
    pub header: Header,
    /// Capsules in use; 0 when nobody is in view.
    pub capsule_count: u32,
    /// Zero; keeps the layout free of padding.
    pub reserved: u32,
    /// Standard deviation of the tracked positions, metres.
    pub position_sigma: f64,
    /// Where the person stands: the ground point below the pelvis, in the base frame, metres.
    pub stand: [f64; 3],
    /// Body parts, in step with `capsules`.
    pub body: [Code<BodyPart>; HUMAN_CAPSULES_MAX],
    /// The body, in the base frame.
    pub capsules: [Capsule; HUMAN_CAPSULES_MAX],
}
message!(HumanState, 1_416);

coded! {
    /// Assembly feature classes (Section 2.1 of the paper).
    pub enum FeatureClass {
        /// None of the others.
        Other = 0, "other";
        /// Internal thread.
        ThreadedHole = 1, "threaded_hole";
        /// Plain bore.
        SmoothHole = 2, "smooth_hole";
        /// External thread.
        ThreadedAxis = 3, "threaded_axis";
        /// Plain pin or shaft.
        SmoothAxis = 4, "smooth_axis";
        /// Slot or groove.
        Slot = 5, "slot";
        /// Taper.
        Cone = 6, "cone";
        /// Snap buckle.
        Buckle = 7, "buckle";
    }
}

coded! {
    /// Whether a recognition may be acted on.
    pub enum Recognition {
        /// Nothing to look at.
        NoPart = 0, "no_part";
        /// Probability above the model's threshold.
        Sure = 1, "sure";
        /// Probability below it: ask a person.
        Unsure = 2, "unsure";
    }
}

/// A length with its standard uncertainty, metres; both 0 when it does not apply.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Measured {
    /// Value, metres.
    pub value: f64,
    /// Standard uncertainty, metres.
    pub sigma: f64,
}

/// Dimensions of a recognised feature; which apply follows its class.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct FeatureDimensions {
    /// Diameter of a hole, axis or the large end of a cone.
    pub diameter: Measured,
    /// Depth of a hole or slot, height of an axis or cone.
    pub depth: Measured,
    /// Length of a slot or buckle.
    pub length: Measured,
    /// Width of a slot or buckle.
    pub width: Measured,
    /// Pitch of a thread.
    pub pitch: Measured,
}

/// What perception made of a cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Feature {
    /// Header.
    pub header: Header,
    /// Sequence number of the cloud this was made from; 0 before the first.
    pub cloud_seq: u64,
    /// `PointCloud::request` of that cloud.
    pub request: u32,
    /// Verdict.
    pub recognition: Code<Recognition>,
    /// Most probable class.
    pub class: Code<FeatureClass>,
    /// Points segmented as the feature, out of the sampled ones.
    pub segment_count: u32,
    /// Calibrated probabilities, indexed by the class's code; they sum to 1.
    pub probabilities: [f32; FEATURE_CLASSES],
    /// Dimensions.
    pub dimensions: FeatureDimensions,
    /// Frame of the feature: z along its axis, out of the part.
    pub base_from_feature: Pose,
    /// Time perception spent on the cloud, nanoseconds (0 in lockstep).
    pub elapsed_ns: u64,
}
message!(Feature, 232);
