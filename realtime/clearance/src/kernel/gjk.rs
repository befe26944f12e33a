//! Any two convex cores: the separating plane that proves their distance.
//!
//! Gilbert, Johnson, Keerthi (1988): the nearest point to the origin of the difference
//! of both bodies is approached from inside, one support point at a time. Every
//! direction tried is also a proof: no two points are nearer than the gap between the
//! two support planes. The widest gap is what is answered, so a search
//! that stalls, or ends at its limit of steps, errs on the near side.

use nalgebra::Vector3;

use super::simplex::{Corner, Simplex};
use super::{Core, Near, depth};

/// Steps of the search; polyhedra take less than 20, round rims up to 40.
const STEPS: u32 = 64;
/// Gap between what is proven and what was found at which the search ends, metres.
const OPEN: f64 = 1e-9;
/// Cores nearer than this overlap, metres: the direction between them is rounding.
const TOUCHING: f64 = 1e-10;

/// How much of an answer is wanted: pairs farther apart than `limit` are of no
/// interest, and nearer than `enough` it does not matter how near.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted {
    pub(crate) limit: f64,
    pub(crate) enough: f64,
}

impl Wanted {
    /// The distance, whatever it is.
    pub(crate) const ALL: Self = Self { limit: f64::INFINITY, enough: f64::NEG_INFINITY };

    /// The same question about cores that are padded by `radius` in all.
    #[inline]
    pub(crate) fn of_cores(self, radius: f64) -> Self {
        Self { limit: self.limit + radius, enough: self.enough + radius }
    }
}

/// Nearest points of two cores, or `None` when they are farther apart than wanted. `towards`
/// is a guess of the way from the second to the first.
pub(super) fn core_to_core(first: &Core, second: &Core, towards: Vector3<f64>, wanted: Wanted) -> Option<Near> {
    let mut simplex = Simplex::EMPTY;
    let mut away = if towards.norm_squared() > 0.0 { towards } else { Vector3::x() };
    let mut proven = f64::NEG_INFINITY;
    let mut found = f64::INFINITY;
    for _ in 0..STEPS {
        let length = away.norm();
        let direction = away / length;
        let (on_first, on_second) = (first.support(&-direction), second.support(&direction));
        let difference = on_first - on_second;
        proven = proven.max(direction.dot(&difference));
        if proven > wanted.limit {
            return None;
        }
        if found - proven <= OPEN || found <= wanted.enough || simplex.contains(&difference) {
            break;
        }
        let nearest = simplex.add(Corner { difference, on_first, on_second }).filter(|at| at.norm() > TOUCHING);
        let Some(nearest) = nearest else {
            if wanted.enough >= 0.0 {
                return Some(Near { distance: 0.0, on_first, on_second });
            }
            return depth::of_overlap(first, second, simplex.corners(), wanted.limit);
        };
        let length = nearest.norm();
        if length >= found {
            // Rounding: no step leads on from here.
            break;
        }
        (away, found) = (nearest, length);
    }
    let [on_first, on_second] = simplex.points();
    Some(Near { distance: proven, on_first, on_second })
}
