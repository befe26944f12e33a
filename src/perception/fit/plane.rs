//! The part's surface around a feature.

use bumpalo::Bump;
use bumpalo::collections::CollectIn;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Dense, List, quantile, wide};
use crate::perception::sample::{Sample, dot, squared, sub};

/// Half thickness in which a point counts, in scaled units of the sample.
const BAND: f32 = 0.02;
/// Cosine between a point's normal and the plane's for it to count.
const ALIKE: f32 = 0.88;
const HYPOTHESES: usize = 120;
/// Sampled points nearest to the feature that vote.
const VOTERS: usize = 110;

/// Plane normal·p = offset, the normal on the camera's side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    pub(crate) normal: Vector3<f64>,
    pub(crate) offset: f64,
    /// Root mean square distance of its points, metres.
    pub(crate) rms: f64,
}

impl Plane {
    pub(crate) fn height(&self, p: Vector3<f64>) -> f64 {
        self.normal.dot(&p) - self.offset
    }
}

/// The plane that most sampled points beside the feature lie on, refined on dense points.
pub(crate) fn surface(
    cloud: &[[f32; 3]],
    sample: &Sample,
    segment: &[bool],
    dense: &Dense<'_>,
    room: &Bump,
    rng: &mut ChaCha8Rng,
) -> Option<Plane> {
    // In scaled units about the sample's centre, along the camera's axes.
    let scaled = |&i: &u16| sub(cloud[usize::from(i)], sample.centre).map(|v| v / sample.scale);
    let places: List<'_, [f32; 3]> = sample.source.iter().map(scaled).collect_in(room);
    let normals: List<'_, [f32; 3]> = (0..places.len()).map(|i| sample.normal_in_camera(i)).collect_in(room);
    let place = |i: usize| places[i];
    let feature: List<'_, usize> = (0..segment.len()).filter(|&i| segment[i]).collect_in(room);
    let mut voters: List<'_, (f32, usize)> = (0..segment.len())
        .filter(|&i| !segment[i])
        .map(|i| {
            let gap = feature.iter().map(|&f| squared(sub(place(i), place(f)))).fold(f32::INFINITY, f32::min);
            (if gap.is_finite() { gap } else { squared(place(i)) }, i)
        })
        .collect_in(room);
    voters.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    voters.truncate(VOTERS);
    if voters.len() < 8 {
        return None;
    }

    let mut best: Option<(usize, [f32; 3], f32)> = None;
    for _ in 0..HYPOTHESES {
        // One oriented point is a plane.
        let i = voters[rng.random_range(0..voters.len())].1;
        let normal = normals[i];
        let offset = dot(normal, place(i));
        let votes = voters
            .iter()
            .filter(|(_, j)| (dot(normal, place(*j)) - offset).abs() < BAND && dot(normal, normals[*j]) > ALIKE);
        let votes = votes.count();
        if best.is_none_or(|b| votes > b.0) {
            best = Some((votes, normal, offset));
        }
    }
    let (votes, normal, offset) = best?;
    if votes < 10 || votes * 5 < voters.len() {
        return None;
    }
    let voting: List<'_, Vector3<f64>> = voters
        .iter()
        .filter(|(_, j)| (dot(normal, place(*j)) - offset).abs() < BAND)
        .map(|(_, j)| wide(cloud[usize::from(sample.source[*j])]))
        .collect_in(room);
    let middle = voting.iter().sum::<Vector3<f64>>() / voting.len() as f64;
    let reach = 1.3 * voting.iter().map(|p| (p - middle).norm()).fold(0.0, f64::max);
    let near: List<'_, Vector3<f64>> =
        dense.rest.iter().copied().filter(|p| (p - middle).norm() < reach).collect_in(room);

    let normal = wide(normal);
    let mut plane =
        Plane { normal, offset: normal.dot(&wide(sample.centre)) + f64::from(offset * sample.scale), rms: 0.0 };
    let mut band = f64::from(BAND * sample.scale);
    for _ in 0..4 {
        let on: List<'_, Vector3<f64>> =
            near.iter().copied().filter(|p| plane.height(*p).abs() < band).collect_in(room);
        if on.len() < 10 {
            return None;
        }
        plane = least_squares(&on);
        let mut off: List<'_, f64> = on.iter().map(|p| plane.height(*p).abs()).collect_in(room);
        // 1.48 median deviations are a standard deviation.
        band = (4.5 * quantile(&mut off, 0.5)).clamp(20e-6, band);
    }
    Some(plane)
}

/// The plane of least squared distances, its normal towards the camera.
fn least_squares(points: &[Vector3<f64>]) -> Plane {
    let share = 1.0 / points.len() as f64;
    let mean = points.iter().sum::<Vector3<f64>>() * share;
    let covariance = points.iter().fold(Matrix3::zeros(), |sum, p| {
        let d = p - mean;
        sum + d * d.transpose() * share
    });
    let eigen = SymmetricEigen::new(covariance);
    let least = eigen.eigenvalues.imin();
    let mut normal: Vector3<f64> = eigen.eigenvectors.column(least).into();
    if normal.dot(&mean) > 0.0 {
        normal = -normal;
    }
    Plane { normal, offset: normal.dot(&mean), rms: eigen.eigenvalues[least].max(0.0).sqrt() }
}
