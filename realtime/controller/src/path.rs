//! The way through joint space: a fixed-size table of joint positions along a
//! length, with a twice continuously differentiable curve through them.
//!
//! What is clear along a path stays clear however fast it is followed, so
//! where and when are kept apart: this is the *where*, [`crate::law`] the *when*.
//! Between neighbours at distance h the curve is the cubic
//! `q(s) = A q_i + B q_(i+1) + ((A³ - A) M_i + (B³ - B) M_(i+1)) h²/6` with
//! `B = (s - s_i)/h`, `A = 1 - B`, and the second derivatives M from a
//! tridiagonal system (clamped ends). A straight joint-space move is the case of
//! two nodes and M = 0.

use tandem_kinematics::Chain;
use tandem_msg::JOINTS_MAX;

use crate::Joints;
use crate::law::LawLimits;

/// Joint positions a path has room for.
pub(crate) const NODES_MAX: usize = 33;
/// Control points of a path that is drawn by them instead.
pub(crate) const CONTROLS: usize = NODES_MAX + 2;

/// Shares of a joint's limit that a bent path may take for the terms `q'' u²`, `q''' u³` and `3 q'' u a`.
const BEND: f64 = 0.4;
const TWIST: f64 = 0.2;
const CROSS: f64 = 0.4;

/// Where the joints are at a length, and their derivatives by it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PathPoint {
    pub(crate) position: Joints,
    pub(crate) first: Joints,
    pub(crate) second: Joints,
}

/// A path. Length in rad of the joint that moves most, or in metres of the TCP on straight stretches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Path {
    nodes: [Joints; NODES_MAX],
    curvature: [Joints; NODES_MAX],
    count: usize,
    length: f64,
}

impl Path {
    /// A path that stays where it is.
    pub(crate) fn point(at: &Joints) -> Self {
        Self { nodes: [*at; NODES_MAX], curvature: [[0.0; JOINTS_MAX]; NODES_MAX], count: 2, length: 0.0 }
    }

    /// All joints in proportion from one position to another.
    pub(crate) fn line(from: &Joints, to: &Joints) -> Self {
        let mut path = Self::point(from);
        path.nodes[1] = *to;
        path.length = from.iter().zip(to).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        path
    }

    /// The smooth curve through `count` equally spaced nodes.
    pub(crate) fn through(nodes: &[Joints; NODES_MAX], count: usize, length: f64) -> Self {
        let count = count.clamp(2, NODES_MAX);
        let mut path = Self { nodes: *nodes, curvature: [[0.0; JOINTS_MAX]; NODES_MAX], count, length };
        if count >= 5 && length > 0.0 {
            for joint in 0..JOINTS_MAX {
                path.bend(joint);
            }
        }
        path
    }

    /// The cubic B-spline with these control points, each node of it between three of them.
    pub(crate) fn spline(controls: &[Joints; CONTROLS], length: f64) -> Self {
        let mut path = Self { length, count: NODES_MAX, ..Self::point(&controls[0]) };
        let h = path.spacing();
        for ((node, curvature), three) in path.nodes.iter_mut().zip(&mut path.curvature).zip(controls.windows(3)) {
            let [before, at, after] = [0, 1, 2].map(|k| three[k]);
            *node = core::array::from_fn(|joint| (before[joint] + 4.0 * at[joint] + after[joint]) / 6.0);
            *curvature = core::array::from_fn(|joint| (before[joint] - 2.0 * at[joint] + after[joint]) / (h * h));
        }
        path
    }

    /// Sets the control points that decide how a path of that length begins, so that it goes on from a point of another
    /// one: position and both derivatives are the same. Says how many they are.
    pub(crate) fn begin_as(controls: &mut [Joints; CONTROLS], point: &PathPoint, length: f64) -> usize {
        let h = length / (NODES_MAX - 1) as f64;
        let around = |slopes: f64| -> Joints {
            core::array::from_fn(|joint| {
                let (slope, bend) = (h * point.first[joint], h * h * point.second[joint]);
                point.position[joint] - bend / 6.0 + slopes * slope + slopes * slopes * 0.5 * bend
            })
        };
        (controls[0], controls[1], controls[2]) = (around(-1.0), around(0.0), around(1.0));
        3
    }

    /// Solves for the second derivatives of one joint; end slopes by one-sided differences of fourth order.
    fn bend(&mut self, joint: usize) {
        let last = self.count - 1;
        let h = self.spacing();
        let q = |i: usize| self.nodes[i][joint];
        let slope = |q: [f64; 5]| (-25.0 * q[0] + 48.0 * q[1] - 36.0 * q[2] + 16.0 * q[3] - 3.0 * q[4]) / (12.0 * h);
        let first = slope([0, 1, 2, 3, 4].map(q));
        let end = -slope([0, 1, 2, 3, 4].map(|k| q(last - k)));
        // Rows: (2 1), (1 4 1) ..., (1 2), right-hand sides as below; Thomas' algorithm.
        let mut upper = [0.0; NODES_MAX];
        let mut right = [0.0; NODES_MAX];
        upper[0] = 0.5;
        right[0] = 3.0 / h * ((q(1) - q(0)) / h - first);
        for i in 1..=last {
            let (diagonal, above, value) = if i == last {
                (2.0, 0.0, 6.0 / h * (end - (q(last) - q(last - 1)) / h))
            } else {
                (4.0, 1.0, 6.0 / (h * h) * (q(i + 1) - 2.0 * q(i) + q(i - 1)))
            };
            let pivot = diagonal - upper[i - 1];
            upper[i] = above / pivot;
            right[i] = (value - right[i - 1]) / pivot;
        }
        let mut m = 0.0;
        for i in (0..=last).rev() {
            m = right[i] - upper[i] * m;
            self.curvature[i][joint] = m;
        }
    }

    pub(crate) fn length(&self) -> f64 {
        self.length
    }

    pub(crate) fn start(&self) -> &Joints {
        &self.nodes[0]
    }

    pub(crate) fn end(&self) -> &Joints {
        &self.nodes[self.count.clamp(2, NODES_MAX) - 1]
    }

    /// Joint positions along it.
    pub(crate) fn nodes(&self) -> &[Joints] {
        &self.nodes[..self.count.clamp(2, NODES_MAX)]
    }

    fn spacing(&self) -> f64 {
        self.length / (self.count - 1) as f64
    }

    /// The point at a length; outside 0..=length the nearer end.
    pub(crate) fn at(&self, length: f64) -> PathPoint {
        if !(self.length > 0.0) {
            return PathPoint { position: self.nodes[0], ..PathPoint::default() };
        }
        let h = self.spacing();
        let along = length.clamp(0.0, self.length) / h;
        let i = (along as usize).min(self.count - 2);
        let b = along - i as f64;
        let a = 1.0 - b;
        let mut point = PathPoint::default();
        for joint in 0..JOINTS_MAX {
            let (q0, q1) = (self.nodes[i][joint], self.nodes[i + 1][joint]);
            let (m0, m1) = (self.curvature[i][joint], self.curvature[i + 1][joint]);
            point.position[joint] = a * q0 + b * q1 + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * h * h / 6.0;
            point.first[joint] = (q1 - q0) / h + ((3.0 * b * b - 1.0) * m1 - (3.0 * a * a - 1.0) * m0) * h / 6.0;
            point.second[joint] = a * m0 + b * m1;
        }
        point
    }

    /// Largest absolute first, second and third derivative of one joint between two nodes.
    fn peaks(&self, piece: usize, joint: usize) -> [f64; 3] {
        if self.length <= 0.0 {
            return [0.0; 3];
        }
        let h = self.spacing();
        let (m0, m1) = (self.curvature[piece][joint], self.curvature[piece + 1][joint]);
        let mean = (self.nodes[piece + 1][joint] - self.nodes[piece][joint]) / h;
        let slope = |b: f64| {
            let a = 1.0 - b;
            mean + ((3.0 * b * b - 1.0) * m1 - (3.0 * a * a - 1.0) * m0) * h / 6.0
        };
        let mut first = slope(0.0).abs().max(slope(1.0).abs());
        if m0 * m1 < 0.0 {
            first = first.max(slope(m0 / (m0 - m1)).abs());
        }
        [first, m0.abs().max(m1.abs()), (m1 - m0).abs() / h]
    }

    /// Pieces between nodes.
    fn pieces(&self) -> usize {
        self.count.clamp(2, NODES_MAX) - 1
    }

    /// Seconds per length that a piece takes at least when the law neither speeds up nor slows down.
    pub(crate) fn slowness(&self, chain: &Chain, piece: usize) -> f64 {
        let mut slow = [0.0_f64; 3];
        for (index, joint) in chain.joints().iter().enumerate() {
            let [first, second, third] = self.peaks(piece, index);
            slow[0] = slow[0].max(first / joint.velocity_max);
            slow[1] = slow[1].max(second / (BEND * joint.acceleration_max));
            slow[2] = slow[2].max(third / (TWIST * joint.jerk_max));
        }
        slow[0].max(slow[1].sqrt()).max(slow[2].cbrt())
    }

    /// Limits of the law along this path under which every joint keeps its own.
    ///
    /// With u, a, j of the law: `q' u`, `q'' u² + q' a`, `q''' u³ + 3 q'' u a + q' j`. Of the
    /// joint's acceleration and jerk a bent path may take fixed shares for the terms in u alone;
    /// on a straight one the law gets them whole. `speed` scales velocities only, so that an arm
    /// that is told to be slow still stops as hard as it can.
    ///
    /// `tcp_speed_max` (m/s) caps the TCP's speed, sampled with a tenth to spare.
    pub(crate) fn limits(&self, chain: &Chain, speed: f64, tcp_speed_max: f64) -> LawLimits {
        const FLAT: f64 = 1e-9;
        let joints = chain.joints();
        let mut limits = LawLimits { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };
        for piece in 0..self.pieces() {
            for (index, joint) in joints.iter().enumerate() {
                let [first, second, third] = self.peaks(piece, index);
                if first > FLAT {
                    limits.velocity = limits.velocity.min(speed * joint.velocity_max / first);
                }
                if second > FLAT {
                    limits.velocity = limits.velocity.min((BEND * joint.acceleration_max / second).sqrt());
                }
                if third > FLAT {
                    limits.velocity = limits.velocity.min((TWIST * joint.jerk_max / third).cbrt());
                }
            }
        }
        limits.velocity = limits.velocity.min(speed * tcp_speed_max / (1.1 * self.tcp_rate(chain)).max(FLAT));
        let u = limits.velocity;
        for piece in 0..self.pieces() {
            for (index, joint) in joints.iter().enumerate() {
                let [first, second, _] = self.peaks(piece, index);
                if first > FLAT {
                    limits.acceleration = limits.acceleration.min((joint.acceleration_max - second * u * u) / first);
                }
                if second > FLAT {
                    limits.acceleration = limits.acceleration.min(CROSS * joint.jerk_max / (3.0 * second * u));
                }
            }
        }
        for piece in 0..self.pieces() {
            for (index, joint) in joints.iter().enumerate() {
                let [first, second, third] = self.peaks(piece, index);
                if first > FLAT {
                    let bent = third * u * u * u + 3.0 * second * u * limits.acceleration;
                    limits.jerk = limits.jerk.min((joint.jerk_max - bent) / first);
                }
            }
        }
        limits
    }

    /// Travel of the TCP per length.
    pub(crate) fn tcp_travel(&self, chain: &Chain, length: f64) -> f64 {
        let point = self.at(length);
        let poses = chain.forward(&point.position);
        let tcp = poses.base_from_tcp.translation.vector;
        chain.point_velocity(&poses, poses.count, &tcp, &point.first).norm()
    }

    /// Largest travel of the TCP per length: at the nodes, or nine places.
    pub(crate) fn tcp_rate(&self, chain: &Chain) -> f64 {
        let places = self.pieces().max(8);
        (0..=places)
            .fold(0.0, |largest: f64, k| largest.max(self.tcp_travel(chain, self.length * k as f64 / places as f64)))
    }

    /// Bound on how far any point of the arm travels per length: `sum of reach_j max|q_j'|`.
    pub(crate) fn sweep_rate(&self, reach: &Joints) -> f64 {
        let fastest = |joint| (0..self.pieces()).fold(0.0, |most: f64, piece| most.max(self.peaks(piece, joint)[0]));
        reach.iter().enumerate().map(|(joint, reach)| reach * fastest(joint)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A curve through samples of a sine follows it, with its first two derivatives, between the samples.
    #[test]
    fn the_curve_follows_a_smooth_function() {
        let length = 0.8;
        let mut nodes = [[0.0; JOINTS_MAX]; NODES_MAX];
        for (i, node) in nodes.iter_mut().take(21).enumerate() {
            node[2] = (3.0 * length * i as f64 / 20.0).sin();
        }
        let path = Path::through(&nodes, 21, length);
        for k in 0..=1000 {
            let s = length * f64::from(k) / 1000.0;
            let point = path.at(s);
            assert!((point.position[2] - (3.0 * s).sin()).abs() < 2e-6, "at {s}");
            assert!((point.first[2] - 3.0 * (3.0 * s).cos()).abs() < 3e-4, "at {s}");
            assert!((point.second[2] + 9.0 * (3.0 * s).sin()).abs() < 0.04, "at {s}: {}", point.second[2]);
        }
    }

    /// A path drawn by control points goes on from a point of another one without a step in position, slope or bend, and
    /// ends where it should.
    #[test]
    fn a_spline_goes_on_from_another_path() {
        let mut nodes = [[0.0; JOINTS_MAX]; NODES_MAX];
        for (i, node) in nodes.iter_mut().enumerate() {
            *node = core::array::from_fn(|joint| (i as f64 * 0.1 * (1.0 + joint as f64)).sin());
        }
        let first = Path::through(&nodes, NODES_MAX, 1.5);
        for k in 0..20 {
            let left = first.at(1.5 * f64::from(k) / 20.0);
            let mut controls = [[0.0; JOINTS_MAX]; CONTROLS];
            for (i, control) in controls.iter_mut().enumerate() {
                *control = core::array::from_fn(|joint| (i * joint) as f64 * 0.01);
            }
            Path::begin_as(&mut controls, &left, 0.9);
            let second = Path::spline(&controls, 0.9);
            let joined = second.at(0.0);
            for joint in 0..JOINTS_MAX {
                assert!((joined.position[joint] - left.position[joint]).abs() < 1e-12);
                assert!((joined.first[joint] - left.first[joint]).abs() < 1e-9);
                assert!((joined.second[joint] - left.second[joint]).abs() < 1e-7);
            }
            let step = 1e-6;
            let (a, b) = (second.at(0.4), second.at(0.4 + step));
            for joint in 0..JOINTS_MAX {
                assert!(((b.position[joint] - a.position[joint]) / step - a.first[joint]).abs() < 1e-4);
                assert!(((b.first[joint] - a.first[joint]) / step - a.second[joint]).abs() < 1e-2);
            }
        }
    }

    /// The derivatives are those of the position, and the peaks bound them.
    #[test]
    fn derivatives_agree_with_differences() {
        let mut nodes = [[0.0; JOINTS_MAX]; NODES_MAX];
        for (i, node) in nodes.iter_mut().enumerate() {
            node[0] = (i as f64 * 0.3).sin() * 0.2;
            node[1] = (i as f64 * 0.11).cos();
        }
        let path = Path::through(&nodes, NODES_MAX, 1.0);
        let step = 1e-5;
        for k in 1..400 {
            let s = f64::from(k) / 400.0;
            let (before, here, after) = (path.at(s - step), path.at(s), path.at(s + step));
            for joint in 0..2 {
                let first = (after.position[joint] - before.position[joint]) / (2.0 * step);
                let second = (after.first[joint] - before.first[joint]) / (2.0 * step);
                assert!((first - here.first[joint]).abs() < 1e-6);
                assert!((second - here.second[joint]).abs() < 1e-2 * (1.0 + second.abs()));
                let piece = ((s * (NODES_MAX - 1) as f64) as usize).min(NODES_MAX - 2);
                let peaks = path.peaks(piece, joint);
                assert!(here.first[joint].abs() <= peaks[0] + 1e-12);
                assert!(here.second[joint].abs() <= peaks[1] + 1e-12);
            }
        }
    }
}
