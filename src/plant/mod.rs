pub mod camera;
pub mod solid;
