//! What the arm is held against, with boxes around it laid out for vector code.

use nalgebra::Vector3;

use crate::lanes::{Wide, wide};
use crate::obstacle::Obstacle;

/// Obstacles whose boxes are looked at in one go.
pub(crate) const CHUNK: usize = 8;

/// Farther than any scene: where an unused slot is.
const NOWHERE: f64 = 1e9;

/// Up to `N` obstacles. The box around each obstacle's core lies along the base axes.
#[derive(Clone, Debug)]
pub(crate) struct Targets<const N: usize> {
    obstacles: [Obstacle; N],
    count: usize,
    centre: [[f64; N]; 3],
    half: [[f64; N]; 3],
    /// Radius around the core.
    around: [f64; N],
    around_max: f64,
    /// What is answered of an overlap may exceed that of the boxes up to this.
    deepest: [f64; N],
}

impl<const N: usize> Targets<N> {
    pub(crate) const NONE: Self = Self {
        obstacles: [Obstacle::UNUSED; N],
        count: 0,
        centre: [[NOWHERE; N]; 3],
        half: [[0.0; N]; 3],
        around: [0.0; N],
        around_max: 0.0,
        deepest: [0.0; N],
    };

    pub(crate) fn clear(&mut self) {
        self.count = 0;
        self.centre = [[NOWHERE; N]; 3];
        self.around_max = 0.0;
    }

    /// Adds one, as long as there is room.
    pub(crate) fn push(&mut self, obstacle: Obstacle) {
        let index = self.count;
        if index < N {
            let (centre, half, around) = obstacle.bounds();
            for axis in 0..3 {
                self.centre[axis][index] = centre[axis];
                self.half[axis][index] = half[axis];
            }
            self.around[index] = around;
            self.around_max = self.around_max.max(around);
            self.deepest[index] = obstacle.deepest();
            self.obstacles[index] = obstacle;
            self.count += 1;
        }
    }

    pub(crate) fn all(&self) -> &[Obstacle] {
        &self.obstacles[..self.count.min(N)]
    }

    pub(crate) fn around(&self, index: usize) -> f64 {
        self.around[index]
    }

    /// The largest of them.
    pub(crate) fn around_max(&self) -> f64 {
        self.around_max
    }

    /// What is answered of an obstacle's core and of one in a box along the base axes that overlaps its box is
    /// no deeper than this: by that much along one axis, the boxes part.
    pub(crate) fn depth_max(&self, index: usize, centre: &Vector3<f64>, half: &Vector3<f64>) -> f64 {
        let overlap =
            |axis: usize| self.half[axis][index] + half[axis] - (self.centre[axis][index] - centre[axis]).abs();
        overlap(0).min(overlap(1)).min(overlap(2)).max(self.deepest[index])
    }

    /// Squared distances from a box along the base axes to the box around each obstacle's core.
    #[inline]
    pub(crate) fn squared_gaps(&self, centre: &Vector3<f64>, half: &Vector3<f64>) -> [f64; N] {
        wide(Gaps::of(self, centre, half))
    }

    /// The least of [`Targets::squared_gaps`].
    #[inline]
    pub(crate) fn squared_gap_min(&self, centre: &Vector3<f64>, half: &Vector3<f64>) -> f64 {
        wide(LeastGap(Gaps::of(self, centre, half)))
    }

    /// Squared distance from a box along the base axes to the box around one obstacle's core.
    pub(crate) fn squared_gap(&self, index: usize, centre: &Vector3<f64>, half: &Vector3<f64>) -> f64 {
        (0..3).fold(0.0, |sum, axis| {
            let apart = (self.centre[axis][index] - centre[axis]).abs() - (self.half[axis][index] + half[axis]);
            let apart = apart.max(0.0);
            sum + apart * apart
        })
    }
}

/// See [`Targets::squared_gaps`].
struct Gaps<'a, const N: usize> {
    targets: &'a Targets<N>,
    centre: [f64; 3],
    half: [f64; 3],
}

impl<'a, const N: usize> Gaps<'a, N> {
    fn of(targets: &'a Targets<N>, centre: &Vector3<f64>, half: &Vector3<f64>) -> Self {
        Self { targets, centre: [centre.x, centre.y, centre.z], half: [half.x, half.y, half.z] }
    }
}

impl<const N: usize> Wide for Gaps<'_, N> {
    type Output = [f64; N];

    #[inline(always)]
    fn run(self) -> [f64; N] {
        let mut gaps = [0.0; N];
        for axis in 0..3 {
            let (centre, half) = (self.centre[axis], self.half[axis]);
            for (index, gap) in gaps.iter_mut().enumerate() {
                let apart = (self.targets.centre[axis][index] - centre).abs();
                let apart = apart - (self.targets.half[axis][index] + half);
                let apart = if apart > 0.0 { apart } else { 0.0 };
                *gap += apart * apart;
            }
        }
        gaps
    }
}

struct LeastGap<'a, const N: usize>(Gaps<'a, N>);

impl<const N: usize> Wide for LeastGap<'_, N> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        const { assert!(N.is_multiple_of(CHUNK)) };
        let mut least = [f64::INFINITY; CHUNK];
        for chunk in self.0.run().chunks_exact(CHUNK) {
            for (least, gap) in least.iter_mut().zip(chunk) {
                *least = if *gap < *least { *gap } else { *least };
            }
        }
        least.iter().fold(f64::INFINITY, |least, gap| if *gap < least { *gap } else { least })
    }
}
