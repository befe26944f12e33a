//! How well the parts of a labelled folder are recognised.

use tandem_config::{LabelledPart, PartSet};
use tandem_msg::{Coded, FEATURE_CLASSES};

use super::{Shape, View, in_camera, read};
use crate::perception::{Perception, Recognised};

/// What was answered to all looks at a folder's parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Looks, and those answered rightly.
    pub looks: u32,
    /// Right among them.
    pub right: u32,
    /// Sure answers, and those of them that are right.
    pub sure: u32,
    /// Right among them.
    pub sure_right: u32,
    /// Answers by true class (rows) and answered class, both by code.
    pub confusion: [[u32; FEATURE_CLASSES]; FEATURE_CLASSES],
}

impl Score {
    /// Share of looks answered rightly; one that showed too little to answer counts as wrong.
    pub fn accuracy(&self) -> f64 {
        f64::from(self.right) / f64::from(self.looks.max(1))
    }

    /// Share of right ones among the sure answers.
    pub fn accuracy_when_sure(&self) -> f64 {
        f64::from(self.sure_right) / f64::from(self.sure.max(1))
    }

    fn add(&mut self, part: &LabelledPart, seen: &Recognised, threshold: f64) {
        let right = u32::from(seen.class == part.class);
        let sure = u32::from(seen.is_sure(threshold));
        self.right += right;
        self.sure += sure;
        self.sure_right += sure * right;
        self.confusion[part.class.code() as usize][seen.class.code() as usize] += 1;
    }
}

/// Looks at every part of a set, at each mesh `looks` times from other sides, at a cloud once; `told` hears
/// of each part the answers, `None` where there was too little to see.
///
/// # Errors
/// The first part that cannot be read, with file, place and value.
pub fn score(
    perception: &mut Perception,
    set: &PartSet,
    looks: u32,
    mut told: impl FnMut(&LabelledPart, &[Option<Recognised>]),
) -> Result<Score, String> {
    let threshold = perception.card().threshold;
    let mut score = Score::default();
    for part in &set.parts {
        let shape = read(&part.file, set.unit).map_err(|error| error.to_string())?;
        let looks = if matches!(shape, Shape::Mesh(..)) { looks } else { 1 };
        let mut answers = Vec::new();
        for look in 0..looks {
            let half_width = part.width.map(|width| 0.5 * width);
            let view = View { at: part.at, axis: part.axis, up: part.up, half_width, look };
            let cloud = in_camera(&shape, Some(&view)).map_err(|error| format!("{}: {error}", part.file.display()))?;
            answers.push(perception.recognise(&cloud));
        }
        score.looks += looks;
        for seen in answers.iter().flatten() {
            score.add(part, seen, threshold);
        }
        told(part, &answers);
    }
    Ok(score)
}
