//! A tree of joint positions with room for so many, and the nearest of them.

#![allow(clippy::disallowed_types, reason = "allocated when it is made, never after")]

use tandem_kinematics::JOINTS_MAX;

use crate::Joints;

/// Nodes that are compared at once.
const LANES: usize = 8;

/// Joint positions with their parents. The first `roots` have none.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    positions: Box<[Joints]>,
    parents: Box<[u32]>,
    /// Whether a branch from here has met something.
    hemmed: Box<[bool]>,
    /// The positions once more, lane by lane and times the weights: single precision is enough to say which is near.
    lanes: Box<[[[f32; LANES]; JOINTS_MAX]]>,
    weights: Joints,
    joints: usize,
    count: usize,
    roots: usize,
}

impl Tree {
    pub(crate) fn new(capacity: usize) -> Self {
        let far = [[f32::INFINITY; LANES]; JOINTS_MAX];
        Self {
            positions: vec_of([0.0; JOINTS_MAX], capacity),
            parents: vec_of(0, capacity),
            hemmed: vec_of(false, capacity),
            lanes: vec_of(far, capacity.div_ceil(LANES)),
            weights: [1.0; JOINTS_MAX],
            joints: 0,
            count: 0,
            roots: 0,
        }
    }

    /// Empties it; distances are Euclidean in `weights` times the first `joints` positions.
    pub(crate) fn begin(&mut self, joints: usize, weights: &Joints) {
        self.joints = joints.min(JOINTS_MAX);
        self.weights = *weights;
        self.count = 0;
        self.roots = 0;
    }

    /// Keeps the roots alone.
    pub(crate) fn cut(&mut self) {
        let roots = self.roots;
        let mut kept = [[0.0; JOINTS_MAX]; crate::ROOTS_MAX];
        for (slot, position) in kept.iter_mut().zip(&self.positions[..roots]) {
            *slot = *position;
        }
        self.count = 0;
        for position in &kept[..roots.min(kept.len())] {
            self.put(position, 0);
        }
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    pub(crate) fn is_full(&self) -> bool {
        self.count >= self.positions.len()
    }

    pub(crate) fn position(&self, node: usize) -> &Joints {
        &self.positions[node]
    }

    pub(crate) fn roots(&self) -> &[Joints] {
        &self.positions[..self.roots]
    }

    /// `None` for a root.
    pub(crate) fn parent(&self, node: usize) -> Option<usize> {
        (node >= self.roots).then(|| self.parents[node] as usize)
    }

    pub(crate) fn is_hemmed(&self, node: usize) -> bool {
        self.hemmed[node]
    }

    pub(crate) fn hem(&mut self, node: usize) {
        self.hemmed[node] = true;
    }

    /// Only before the first node.
    pub(crate) fn add_root(&mut self, position: &Joints) {
        if self.put(position, 0).is_some() {
            self.roots = self.count;
        }
    }

    /// Takes a root away again; only before the first node.
    pub(crate) fn remove_root(&mut self, root: usize) {
        self.positions[root..self.roots].rotate_left(1);
        self.roots -= 1;
        self.cut();
    }

    /// The new node, or `None` when there is no room.
    pub(crate) fn add(&mut self, position: &Joints, parent: usize) -> Option<usize> {
        self.put(position, parent)
    }

    fn put(&mut self, position: &Joints, parent: usize) -> Option<usize> {
        if self.is_full() {
            return None;
        }
        let node = self.count;
        self.positions[node] = *position;
        self.parents[node] = parent as u32;
        self.hemmed[node] = false;
        let block = &mut self.lanes[node / LANES];
        if node.is_multiple_of(LANES) {
            // What stood here before is of another search.
            *block = [[f32::INFINITY; LANES]; JOINTS_MAX];
        }
        for (joint, row) in block.iter_mut().enumerate() {
            row[node % LANES] = (position[joint] * self.weights[joint]) as f32;
        }
        self.count += 1;
        Some(node)
    }

    /// The node nearest to a position; the first of those that are equally near.
    pub(crate) fn nearest(&self, to: &Joints) -> usize {
        let mut target = [0.0_f32; JOINTS_MAX];
        for (joint, slot) in target.iter_mut().enumerate() {
            *slot = (to[joint] * self.weights[joint]) as f32;
        }
        let mut least = [f32::INFINITY; LANES];
        let mut blocks = [0_u32; LANES];
        for (index, block) in self.lanes[..self.count.div_ceil(LANES)].iter().enumerate() {
            let mut sums = [0.0_f32; LANES];
            for (row, target) in block[..self.joints].iter().zip(&target) {
                for (sum, position) in sums.iter_mut().zip(row) {
                    let apart = position - target;
                    *sum += apart * apart;
                }
            }
            for lane in 0..LANES {
                let nearer = sums[lane] < least[lane];
                least[lane] = if nearer { sums[lane] } else { least[lane] };
                blocks[lane] = if nearer { index as u32 } else { blocks[lane] };
            }
        }
        let mut best = (f32::INFINITY, 0);
        for lane in 0..LANES {
            let node = blocks[lane] as usize * LANES + lane;
            if least[lane] < best.0 || (least[lane] == best.0 && node < best.1) {
                best = (least[lane], node);
            }
        }
        best.1.min(self.count.saturating_sub(1))
    }
}

#[allow(clippy::disallowed_macros, reason = "made before the first cycle")]
fn vec_of<T: Copy>(value: T, count: usize) -> Box<[T]> {
    vec![value; count].into_boxed_slice()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::Draws;

    /// The nearest is no farther than any other, in a tree that has been used before.
    #[test]
    fn the_nearest_is_nearest() {
        let weights = [1.0, 2.0, 0.5, 1.0, 1.0, 0.3, 1.0, 1.0];
        let mut draws = Draws::new(3);
        let mut tree = Tree::new(100);
        for (count, joints) in [(100, 6), (37, 7), (1, 2)] {
            tree.begin(joints, &weights);
            let mut draw = || core::array::from_fn(|k| if k < joints { draws.share() } else { 0.0 });
            tree.add_root(&draw());
            while tree.count() < count {
                assert_eq!(tree.add(&draw(), 0), Some(tree.count() - 1));
            }
            assert_eq!(tree.is_full(), count == 100);
            for _ in 0..200 {
                let to: Joints = draw();
                let apart = |node: usize| -> f64 {
                    let position = tree.position(node);
                    (0..joints).map(|k| (weights[k] * (position[k] - to[k])).powi(2)).sum()
                };
                let nearest = apart(tree.nearest(&to));
                assert!((0..count).all(|node| nearest <= apart(node) + 1e-5), "{count} nodes, {joints} joints");
            }
        }
    }

    /// Cutting leaves the roots, in their order.
    #[test]
    fn roots_stay() {
        let at = |x: f64| [x; JOINTS_MAX];
        let mut tree = Tree::new(8);
        tree.begin(1, &at(1.0));
        for x in [1.0, 2.0, 3.0] {
            tree.add_root(&at(x));
        }
        tree.remove_root(1);
        tree.add(&at(5.0), 1);
        assert_eq!((tree.parent(1), tree.parent(2), tree.nearest(&at(4.5))), (None, Some(1), 2));
        tree.cut();
        assert_eq!(tree.roots(), [at(1.0), at(3.0)]);
        assert_eq!((tree.count(), tree.nearest(&at(4.5))), (2, 1));
    }
}
