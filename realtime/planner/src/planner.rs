//! The search: two trees, one step after the other.

use tandem_clearance::{Monitor, MotionSweep, Swept};
use tandem_kinematics::{Chain, JOINTS_MAX, JointKind};

use crate::Joints;
use crate::draws::Draws;
use crate::shorten::{Pass, Polyline, Shortcut, apart};
use crate::tree::Tree;

/// Starts, and goals, that a request may have.
pub const ROOTS_MAX: usize = 8;
/// Longest branch, weighted: radians of a joint that swings the whole arm.
const RANGE: f64 = 0.6;
/// Where a branch has met something, only places drawn from no farther than this call for another (the
/// dynamic domain of Yershova et al., *Dynamic-Domain RRTs*, ICRA 2005): else the nodes at the edge of
/// what is free would take all the draws and yield nothing.
const DOMAIN: f64 = 2.0;
/// A branch that meets something is tried once more, so much shorter.
const SHORTER: f64 = 0.5;
/// Least weight of a joint: one that hardly moves the arm still takes time to turn.
const WEIGHT_MIN: f64 = 0.25;
/// Nodes that are compared in the time of one look.
const NODES_PER_LOOK: usize = 1_024;

/// What a path must keep and what may be spent on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Distance the path keeps to scene and arm itself, metres.
    pub margin: f64,
    /// Where there is less than this beyond the margin, a motion may be refused, metres. Smaller means more
    /// looks in narrow places.
    pub resolution: f64,
    /// Looks at the scene after which the search is given up; those for shortening come on top.
    pub looks_max: u32,
    /// Where the randomness comes from.
    pub seed: u64,
}

impl Default for Request {
    /// What a bench-top arm in a cell plans with.
    fn default() -> Self {
        Self { margin: 0.010, resolution: 0.005, looks_max: 300_000, seed: 0 }
    }
}

/// Why no path was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Every start is too near to something, outside the limits, or no number.
    StartBlocked,
    /// The same of every goal.
    GoalBlocked,
    /// The looks that were allowed are spent: there may be a path or not.
    Spent,
}

/// How a search stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is more to do.
    Searching,
    /// [`Planner::path`] is the answer.
    Found,
    /// There is none.
    Failed(Failure),
}

/// What a search has taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effort {
    /// Looks at the scene, and as many comparisons of nodes as take that long.
    pub looks: u32,
    /// Of them, looks of the search; the rest is shortening.
    pub search_looks: u32,
    /// Joint positions in the trees at the end.
    pub nodes: usize,
    /// Times the trees were grown anew.
    pub restarts: u32,
}

#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is one of it, in place; a box would be heap")]
enum Step {
    /// Look at a root of the tree in hand.
    Root {
        root: usize,
    },
    /// Straight from a start to a goal, by their pair's number.
    Straight {
        pair: usize,
    },
    StraightSweep {
        pair: usize,
    },
    /// A branch towards a place that is drawn.
    Grow,
    GrowSweep {
        from: usize,
        shorter: bool,
    },
    /// From the other tree towards the new node.
    Connect {
        from: usize,
        target: usize,
    },
    ConnectSweep {
        from: usize,
        target: usize,
    },
    Shorten {
        pass: Pass,
    },
    ShortenSweep {
        pass: Pass,
        shortcut: Shortcut,
    },
    Found,
    Failed(Failure),
}

/// The planner. Its memory is taken when it is made: about 200 bytes for each of `2 × nodes`.
#[derive(Clone, Debug)]
pub struct Planner {
    request: Request,
    /// From the starts, from the goals.
    trees: [Tree; 2],
    /// The tree that grows; the other connects.
    growing: usize,
    step: Step,
    sweep: MotionSweep,
    /// Where the sweep in hand leads.
    towards: Joints,
    draws: Draws,
    weights: Joints,
    /// Positions are drawn from these ranges.
    lowest: Joints,
    span: Joints,
    path: Polyline,
    roots: [usize; 2],
    effort: Effort,
}

impl Planner {
    /// A planner with room for so many joint positions in each of its two trees; they are grown anew
    /// when one is full.
    pub fn new(nodes: usize) -> Self {
        let nodes = nodes.max(2 * ROOTS_MAX);
        Self {
            request: Request::default(),
            trees: [Tree::new(nodes), Tree::new(nodes)],
            growing: 0,
            step: Step::Failed(Failure::StartBlocked),
            sweep: MotionSweep::new(),
            towards: [0.0; JOINTS_MAX],
            draws: Draws::new(0),
            weights: [1.0; JOINTS_MAX],
            lowest: [0.0; JOINTS_MAX],
            span: [0.0; JOINTS_MAX],
            path: Polyline::new(),
            roots: [0; 2],
            effort: Effort::default(),
        }
    }

    /// Begins a search from any of `starts` to any of `goals`, joint positions in rad or m; those past
    /// [`ROOTS_MAX`] are left out, and so are those that are not within limits and clear by the margin.
    pub fn begin(&mut self, chain: &Chain, monitor: &Monitor, starts: &[Joints], goals: &[Joints], request: &Request) {
        self.request = *request;
        self.draws = Draws::new(request.seed);
        self.effort = Effort::default();
        self.path.clear();
        self.growing = 0;
        self.weights = weights(chain, monitor);
        let joints = chain.joint_count();
        for (tree, roots) in self.trees.iter_mut().zip([starts, goals]) {
            tree.begin(joints, &self.weights);
            let mut sound = roots.iter().filter(|root| chain.is_within_limits(root, 0.0));
            while tree.count() < ROOTS_MAX
                && let Some(root) = sound.next()
            {
                tree.add_root(root);
            }
        }
        self.choose_ranges(chain);
        self.step = Step::Root { root: 0 };
    }

    /// Does what takes about as long as `looks` looks at the scene, at least one step. Between [`Planner::begin`]
    /// and the end neither the chain nor the monitor's scene, part and permissions may change.
    ///
    /// # Realtime
    /// Bounded by `looks` and a few; no allocation.
    pub fn work(&mut self, chain: &Chain, monitor: &Monitor, looks: u32) -> Progress {
        let until = self.effort.looks.saturating_add(looks);
        loop {
            match self.step {
                Step::Found => return Progress::Found,
                Step::Failed(failure) => return Progress::Failed(failure),
                _ if self.effort.looks >= until => return Progress::Searching,
                step => self.step = self.advance(step, chain, monitor),
            }
        }
    }

    /// Searches to the end: [`Planner::begin`], then work until there is nothing more to do.
    ///
    /// # Errors
    /// Why there is no path.
    pub fn solve(
        &mut self,
        chain: &Chain,
        monitor: &Monitor,
        starts: &[Joints],
        goals: &[Joints],
        request: &Request,
    ) -> Result<&[Joints], Failure> {
        self.begin(chain, monitor, starts, goals, request);
        loop {
            match self.work(chain, monitor, u32::MAX) {
                Progress::Searching => {}
                Progress::Found => return Ok(self.path()),
                Progress::Failed(failure) => return Err(failure),
            }
        }
    }

    /// The path that was found: joint positions, with straight motions between them. Empty before.
    pub fn path(&self) -> &[Joints] {
        match self.step {
            Step::Found => self.path.positions(),
            _ => &[],
        }
    }

    /// What the search in hand, or the last, has taken.
    pub fn effort(&self) -> Effort {
        Effort { nodes: self.trees.iter().map(Tree::count).sum(), ..self.effort }
    }

    /// A joint turns no farther than half a turn beyond starts and goals: any place is within that.
    fn choose_ranges(&mut self, chain: &Chain) {
        for (index, joint) in chain.joints().iter().enumerate() {
            let roots = self.trees.iter().flat_map(|tree| tree.roots()).map(|root| root[index]);
            let (least, most) = roots.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), q| (a.min(q), b.max(q)));
            let beyond = if joint.kind == JointKind::Revolute { core::f64::consts::PI } else { f64::INFINITY };
            self.lowest[index] = joint.position_min.max(least - beyond);
            self.span[index] = joint.position_max.min(most + beyond) - self.lowest[index];
        }
    }

    fn advance(&mut self, step: Step, chain: &Chain, monitor: &Monitor) -> Step {
        match step {
            Step::Root { root } => self.look_at_root(root, chain, monitor),
            Step::Straight { pair } => self.begin_straight(pair, monitor),
            Step::StraightSweep { pair } => match self.look(chain, monitor) {
                Swept::More => step,
                Swept::Blocked => Step::Straight { pair: pair + 1 },
                Swept::Clear => {
                    let [from, to] = self.pair(pair);
                    self.found(from, to)
                }
            },
            Step::Grow => self.grow(monitor),
            Step::GrowSweep { from, shorter } => match self.look(chain, monitor) {
                Swept::More => step,
                Swept::Blocked if shorter => {
                    self.trees[self.growing].hem(from);
                    Step::Grow
                }
                Swept::Blocked => {
                    let at = *self.trees[self.growing].position(from);
                    self.towards = core::array::from_fn(|k| at[k] + SHORTER * (self.towards[k] - at[k]));
                    self.sweep.begin(monitor, &at, &self.towards, self.request.margin, self.request.resolution);
                    Step::GrowSweep { from, shorter: true }
                }
                Swept::Clear => match self.trees[self.growing].add(&self.towards, from) {
                    Some(target) => {
                        let from = self.nearest(1 - self.growing, target);
                        Step::Connect { from, target }
                    }
                    None => self.restart(),
                },
            },
            Step::Connect { from, target } => {
                let to = *self.trees[self.growing].position(target);
                let from_at = *self.trees[1 - self.growing].position(from);
                self.steer(&from_at, &to, monitor);
                Step::ConnectSweep { from, target }
            }
            Step::ConnectSweep { from, target } => match self.look(chain, monitor) {
                Swept::More => step,
                Swept::Blocked => Step::Grow,
                Swept::Clear if self.towards == *self.trees[self.growing].position(target) => {
                    if self.growing == 0 {
                        self.found(target, from)
                    } else {
                        self.found(from, target)
                    }
                }
                Swept::Clear => match self.trees[1 - self.growing].add(&self.towards, from) {
                    Some(node) => Step::Connect { from: node, target },
                    None => self.restart(),
                },
            },
            Step::Shorten { mut pass } => {
                if matches!(pass, Pass::Done) {
                    return Step::Found;
                }
                self.effort.looks += 1;
                match self.path.propose(&mut pass, &mut self.draws, &self.weights) {
                    Some(shortcut) => {
                        let [from, to] = shortcut.ends;
                        self.sweep.begin(monitor, &from, &to, self.request.margin, self.request.resolution);
                        Step::ShortenSweep { pass, shortcut }
                    }
                    None => Step::Shorten { pass },
                }
            }
            Step::ShortenSweep { mut pass, shortcut } => match self.look(chain, monitor) {
                Swept::More => step,
                swept => {
                    self.path.settle(&mut pass, &shortcut, swept == Swept::Clear);
                    Step::Shorten { pass }
                }
            },
            Step::Found | Step::Failed(_) => step,
        }
    }

    fn look(&mut self, chain: &Chain, monitor: &Monitor) -> Swept {
        self.effort.looks += 1;
        self.sweep.look(chain, monitor)
    }

    fn look_at_root(&mut self, root: usize, chain: &Chain, monitor: &Monitor) -> Step {
        let tree = &mut self.trees[self.growing];
        if let Some(position) = tree.roots().get(root) {
            self.effort.looks += 1;
            if monitor.is_clear(&chain.forward(position), self.request.margin) {
                return Step::Root { root: root + 1 };
            }
            tree.remove_root(root);
            return Step::Root { root };
        }
        match (tree.count(), self.growing) {
            (0, 0) => Step::Failed(Failure::StartBlocked),
            (0, _) => Step::Failed(Failure::GoalBlocked),
            (_, 0) => {
                self.growing = 1;
                Step::Root { root: 0 }
            }
            _ => Step::Straight { pair: 0 },
        }
    }

    /// Start and goal of a pair.
    fn pair(&self, pair: usize) -> [usize; 2] {
        let goals = self.trees[1].roots().len().max(1);
        [pair / goals, pair % goals]
    }

    fn begin_straight(&mut self, pair: usize, monitor: &Monitor) -> Step {
        let [from, to] = self.pair(pair);
        let (Some(from), Some(to)) = (self.trees[0].roots().get(from), self.trees[1].roots().get(to)) else {
            return Step::Grow;
        };
        self.sweep.begin(monitor, from, to, self.request.margin, self.request.resolution);
        self.effort.looks += 1;
        Step::StraightSweep { pair }
    }

    /// A branch of the smaller tree towards a place that is drawn.
    fn grow(&mut self, monitor: &Monitor) -> Step {
        if self.effort.looks >= self.request.looks_max {
            return Step::Failed(Failure::Spent);
        }
        self.effort.looks += 1;
        self.growing = usize::from(self.trees[1].count() < self.trees[0].count());
        let mut drawn = [0.0; JOINTS_MAX];
        for ((slot, lowest), span) in drawn.iter_mut().zip(&self.lowest).zip(&self.span) {
            *slot = lowest + span * self.draws.share();
        }
        self.compare(self.growing);
        let from = self.trees[self.growing].nearest(&drawn);
        let from_at = *self.trees[self.growing].position(from);
        if self.trees[self.growing].is_hemmed(from) && apart(&from_at, &drawn, &self.weights) > DOMAIN {
            return Step::Grow;
        }
        self.steer(&from_at, &drawn, monitor);
        Step::GrowSweep { from, shorter: false }
    }

    /// Node of one tree that is nearest to one of the other.
    fn nearest(&mut self, tree: usize, node: usize) -> usize {
        self.compare(tree);
        self.trees[tree].nearest(self.trees[1 - tree].position(node))
    }

    /// Accounts for the comparisons in a tree.
    fn compare(&mut self, tree: usize) {
        self.effort.looks += (self.trees[tree].count() / NODES_PER_LOOK) as u32;
    }

    /// Begins the sweep of a branch: towards a place, no longer than a branch may be.
    fn steer(&mut self, from: &Joints, to: &Joints, monitor: &Monitor) {
        let distance = apart(from, to, &self.weights);
        self.towards = if distance > RANGE {
            let share = RANGE / distance;
            core::array::from_fn(|k| from[k] + share * (to[k] - from[k]))
        } else {
            *to
        };
        self.sweep.begin(monitor, from, &self.towards, self.request.margin, self.request.resolution);
    }

    /// Grows both trees anew: their roots alone stay.
    fn restart(&mut self) -> Step {
        self.effort.restarts += 1;
        for tree in &mut self.trees {
            tree.cut();
        }
        Step::Grow
    }

    /// A node of the first tree and one of the second are joined.
    fn found(&mut self, first: usize, second: usize) -> Step {
        self.effort.search_looks = self.effort.looks;
        self.path.clear();
        let mut fits = true;
        for (index, node) in [first, second].into_iter().enumerate() {
            let mut node = node;
            let from = self.path.positions().len();
            loop {
                fits &= self.path.push(self.trees[index].position(node));
                match self.trees[index].parent(node) {
                    Some(parent) => node = parent,
                    None => break,
                }
            }
            self.roots[index] = node;
            if index == 0 {
                self.path.reverse(from);
            }
        }
        if !fits {
            return self.restart();
        }
        Step::Shorten { pass: self.path.first_pass() }
    }
}

/// How far each joint moves the arm, as a share of the one that moves it farthest.
fn weights(chain: &Chain, monitor: &Monitor) -> Joints {
    let joints = chain.joints();
    let mut levers = [0.0_f64; JOINTS_MAX];
    // The farthest point beyond each joint's frame, from the tool inwards.
    let mut beyond = chain.tool().translation.vector.norm();
    for (index, joint) in joints.iter().enumerate().rev() {
        let capsules = monitor.body().capsules().iter().filter(|capsule| capsule.link == index + 1);
        let ends = capsules.flat_map(|capsule| capsule.ends).map(|[x, y, z]| (x * x + y * y + z * z).sqrt());
        beyond = ends.fold(beyond, f64::max);
        levers[index] = if joint.kind == JointKind::Revolute { beyond } else { 1.0 };
        beyond += joint.parent_from_joint.translation.vector.norm();
    }
    let longest = levers.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    levers.map(|lever| (lever / longest).max(WEIGHT_MIN))
}
