//! One transfer as a game: states, moves, rewards; and the ways to play it.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tandem_msg::{Coded, FEATURE_CLASSES};

use super::agent::{Agent, Memory};
use super::discrepancy::discrepancy;
use super::moves::{Group, MOVES, Move, SIGNS, STEPS, Sign, Spread};
use super::protocol::{COST, SHARD, Settings};
use super::rivals::{REFRESH, classes};
use super::similarity::Prototypes;
use super::student::{Answers, Sets, Snapshot, Student, batch, watched};
use crate::learning::encoder::dataset::{Example, Look};
use crate::learning::encoder::pass::{Demand, FEATURES};
use crate::learning::encoder::train::TrainError;

/// Numbers of a state.
pub(crate) const STATE: usize = 9 + SIGNS.len();
/// Equilibrium coefficient m of the reward.
const REWARD: f32 = 10.0;
/// Unlabelled looks that are watched beside the labelled; all that are, where there are no labels.
const WATCHED: [usize; 2] = [32, 96];
/// Source features the discrepancy is taken against.
const BANK: usize = 48;
/// Probability from which the decoder counts as sure.
const SURE: f32 = 0.9;
/// Momentum of the signs.
const MOMENTUM: f32 = 0.9;
/// What is kept of the running mean of the weights at each offset: it spans some two moves.
const AVERAGED: f32 = 0.94;
/// Moves the greedy player tries at a time.
const TRIED: usize = 4;

/// What the source leaves behind for its transfer: its features and what its classes look like.
#[derive(Debug)]
pub(crate) struct Bank {
    pub(crate) features: Vec<f32>,
    pub(crate) prototypes: Prototypes,
}

impl Bank {
    pub(crate) fn new(student: &Student, source: &[Example]) -> Result<Self, TrainError> {
        let looks: Vec<&Look> = source.iter().flat_map(|e| std::iter::once(&e.look).chain(e.closer.as_ref())).collect();
        let labels: Vec<usize> = looks.iter().map(|look| look.class.code() as usize).collect();
        let features = Answers::of(&mut student.engine()?, &looks).features;
        Ok(Self { prototypes: Prototypes::new(&features, &labels), features })
    }
}

/// What is measured after each move.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    /// Δ_F, and of the worst class.
    similarity: f32,
    worst: f32,
    /// Share answered rightly of what has labels.
    right: f32,
    /// How sure the decoder is of what has none.
    sure: f32,
    /// How far the unlabelled are from the source.
    discrepancy: f32,
}

/// A transfer under way.
pub(crate) struct Episode<'a> {
    pub(crate) student: Student,
    bank: &'a Bank,
    sets: Sets<'a>,
    /// Examples whose labels only the reward knows; none at the real target.
    held: &'a [Example],
    /// Of the source, all labelled: keeps the encoder one the frozen decoders can read.
    source: &'a [Example],
    spread: Spread,
    momentum: Vec<f32>,
    /// Running mean of the weights.
    average: Vec<f32>,
    settings: Settings,
    rng: ChaCha8Rng,
    spent: usize,
    now: Measured,
    /// Best Δ_F so far, and the student that had it.
    best: (f32, Snapshot),
    /// What the last move gained, and the last of each kind of sign.
    gained: f32,
    gains: [f32; SIGNS.len()],
    /// Δ_F of the examples held back and the mean probability of their own classes.
    truth: f32,
}

impl<'a> Episode<'a> {
    /// Begins with the statistics of the target, as every method ends with them.
    pub(crate) fn begin(
        mut student: Student,
        (bank, source): (&'a Bank, &'a [Example]),
        sets: Sets<'a>,
        held: &'a [Example],
        settings: Settings,
        seed: u64,
    ) -> Result<Self, TrainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        student.refresh(&batch(sets.unlabelled, REFRESH, &mut rng));
        let mut out = Self {
            spread: Spread::new(&student.run.spans[0]),
            momentum: vec![0.0; student.run.parameters.len()],
            average: student.run.parameters.clone(),
            best: (f32::MIN, student.snapshot()),
            student,
            bank,
            source,
            sets,
            held,
            settings,
            rng,
            spent: COST[0] * REFRESH,
            now: Measured::default(),
            gained: 0.0,
            gains: [0.0; SIGNS.len()],
            truth: 0.0,
        };
        out.measure()?;
        out.gained = 0.0;
        Ok(out)
    }

    /// Share of the budget that is spent.
    pub(crate) fn done(&self) -> f64 {
        (self.spent as f64 / self.end() as f64).min(1.0)
    }

    /// The last refresh is kept back.
    fn end(&self) -> usize {
        self.settings.looks.saturating_sub(COST[0] * REFRESH).max(1)
    }

    pub(crate) fn over(&self) -> bool {
        self.spent >= self.end()
    }

    /// Moves that can be made.
    pub(crate) fn allowed(&self) -> Vec<usize> {
        if self.over() {
            return Vec::new();
        }
        (0..MOVES).filter(|&m| !(self.sets.labelled.is_empty() && Move::of(m).needs_labels())).collect()
    }

    // Eq. (6): S_t = Δ_F. One number does not tell a beginning from an end, nor an encoder that fits the few
    // labels from one that fits the target: beside Δ_F stand the time, the worst class, what
    // was best, what the last moves gained, and what is seen of the unlabelled looks.
    pub(crate) fn state(&self) -> [f32; STATE] {
        let mut out = [0.0; STATE];
        out[..9].copy_from_slice(&[
            self.now.similarity,
            self.done() as f32,
            self.now.worst,
            self.now.similarity - self.best.0,
            (10.0 * self.gained).clamp(-1.0, 1.0),
            self.now.right,
            self.now.sure,
            10.0 * self.now.discrepancy,
            f32::from(u8::from(self.sets.labelled.is_empty())),
        ]);
        for (out, gain) in out[9..].iter_mut().zip(&self.gains) {
            *out = (10.0 * gain).clamp(-1.0, 1.0);
        }
        out
    }

    /// Makes a move and measures what it did; answers its reward.
    //
    // Eq. (8): R = mΔ_F + C with C = −m times the Δ_F before, so that a move is worth what it changes.
    // While the agent learns, on shifts that were made up, Δ_F is that of labelled looks the moves never
    // see, and what Δ_F stands for is added, the probability the decoder gives their own classes: the agent
    // learns what carries over, not what fits the few labels.
    pub(crate) fn make(&mut self, action: usize) -> Result<f32, TrainError> {
        let (before, truth) = (self.now.similarity, self.truth);
        let made = Move::of(action);
        match made {
            Move::Refresh => {
                let looks = batch(self.sets.unlabelled, REFRESH, &mut self.rng);
                self.student.refresh(&looks);
                self.spent += COST[0] * REFRESH;
            }
            Move::Undo => {
                self.student.restore(&self.best.1);
                self.average.clone_from(&self.student.run.parameters);
                self.momentum.fill(0.0);
            }
            Move::Average => {
                // The encoder's only: of what stands still the mean would still round.
                for span in self.spread.of(Group::All) {
                    self.student.run.parameters[span.clone()].copy_from_slice(&self.average[span.clone()]);
                }
                self.momentum.fill(0.0);
            }
            Move::Step(group, sign, unit) => {
                for _ in 0..STEPS {
                    self.gradient(sign);
                    self.offset(group, unit * self.settings.rate);
                    self.spent += 2 * COST[1] * SHARD;
                }
            }
        }
        self.measure()?;
        self.gained = self.now.similarity - before;
        if let Move::Step(_, sign, _) = made {
            for (gain, known) in self.gains.iter_mut().zip(SIGNS) {
                if known == sign {
                    *gain = self.gained;
                }
            }
        }
        let change = if self.held.is_empty() { self.gained } else { self.truth - truth };
        Ok((REWARD * change).clamp(-2.0, 2.0))
    }

    /// Gradient of what signs are taken from, on new looks, into the pass of the target: the labels of the
    /// source and of the target, the frozen decoders reading both, and what the kind of sign adds.
    fn gradient(&mut self, sign: Sign) {
        let few = self.sets.labelled;
        let labelled = match sign {
            _ if few.is_empty() => 0,
            Sign::Similarity | Sign::Labels => SHARD,
            Sign::Discrepancy | Sign::Confident => SHARD / 2,
        };
        let mut looks = batch(few, labelled, &mut self.rng);
        looks.extend(batch(self.sets.unlabelled, SHARD - labelled, &mut self.rng));
        let phase = self.rng.random_range(0..2);
        self.student.see(1, &looks, phase);
        self.student.follow();
        let pass = &self.student.passes[1];
        let mut demand = Demand { classes: classes(&looks), segmented: labelled, ..Demand::default() };
        // The rest have no labels that may be read.
        demand.classes[labelled..].fill(None);
        let mut gradient = Vec::new();
        match sign {
            Sign::Labels => {}
            Sign::Similarity => gradient = self.bank.prototypes.pull(pass.features(), &demand.classes).1,
            Sign::Discrepancy => {
                let rows = self.bank.features.len() / FEATURES;
                let mut ours = Vec::with_capacity(BANK * FEATURES);
                for _ in 0..BANK {
                    let row = self.rng.random_range(0..rows);
                    ours.extend_from_slice(&self.bank.features[row * FEATURES..][..FEATURES]);
                }
                [_, gradient] = discrepancy(&ours, pass.features(), FEATURES).1;
            }
            Sign::Confident => {
                let logits = pass.class_logits.chunks_exact(FEATURE_CLASSES).skip(labelled);
                demand.classes[labelled..].iter_mut().zip(logits).for_each(|(class, logits)| *class = sure_of(logits));
            }
        }
        demand.features = (!gradient.is_empty()).then_some(&gradient[..]);
        self.student.learn(1, &demand);
        let looks = batch(self.source, SHARD, &mut self.rng);
        self.student.see(0, &looks, phase);
        self.student.learn(0, &Demand { classes: classes(&looks), segmented: SHARD, ..Demand::default() });
        let [ours, theirs] = &mut self.student.passes;
        theirs.gradient.iter_mut().zip(&ours.gradient).for_each(|(sum, g)| *sum += g);
    }

    /// Offsets the weights of a group by `unit` against the signs of the gradient, kept with momentum.
    fn offset(&mut self, group: Group, unit: f32) {
        let gradient = &self.student.passes[1].gradient;
        let length = gradient.iter().map(|g| g * g).sum::<f32>().sqrt().max(1e-12);
        for (m, g) in self.momentum.iter_mut().zip(gradient) {
            *m = MOMENTUM * *m + g / length;
        }
        for span in self.spread.of(group) {
            let weights = &mut self.student.run.parameters[span.clone()];
            for (w, m) in weights.iter_mut().zip(&self.momentum[span.clone()]) {
                if *m != 0.0 {
                    *w -= unit * m.signum();
                }
            }
        }
        for (a, w) in self.average.iter_mut().zip(&self.student.run.parameters) {
            *a = AVERAGED * *a + (1.0 - AVERAGED) * w;
        }
    }

    /// Looks at what is watched, as a cell would.
    fn measure(&mut self) -> Result<(), TrainError> {
        let mut engine = self.student.engine()?;
        let without = self.sets.labelled.is_empty();
        let labelled = watched(self.sets.labelled);
        let free = watched(&self.sets.unlabelled[..WATCHED[usize::from(without)].min(self.sets.unlabelled.len())]);
        self.spent += COST[0] * (labelled.len() + free.len());
        let seen = Answers::of(&mut engine, &labelled);
        let guessed = Answers::of(&mut engine, &free);
        let prototypes = &self.bank.prototypes;
        let margins = |answers: &Answers, labels: &[Option<usize>]| -> Vec<f32> {
            answers.features.chunks_exact(FEATURES).zip(labels).map(|(f, l)| prototypes.margin(f, *l)).collect()
        };
        let labels: Vec<Option<usize>> = labelled.iter().map(|look| Some(look.class.code() as usize)).collect();
        let own = if without { margins(&guessed, &vec![None; free.len()]) } else { margins(&seen, &labels) };
        let top = |p: &[f32; FEATURE_CLASSES]| p.iter().fold(0.0_f32, |m, v| m.max(*v));
        let right = seen.probabilities.iter().zip(&labels).filter(|(p, l)| l.is_some_and(|l| p[l] == top(p))).count();
        let mut worst = f32::MAX;
        for class in 0..FEATURE_CLASSES {
            let of: Vec<f32> = own.iter().zip(&labels).filter(|(_, l)| **l == Some(class)).map(|(m, _)| *m).collect();
            if !of.is_empty() {
                worst = worst.min(mean(&of));
            }
        }
        self.now = Measured {
            similarity: mean(&own),
            worst: if without { 0.0 } else { worst },
            right: right as f32 / labels.len().max(1) as f32,
            sure: mean(&guessed.probabilities.iter().map(top).collect::<Vec<_>>()),
            discrepancy: discrepancy(&self.bank.features[..BANK * FEATURES], &guessed.features, FEATURES).0,
        };
        if self.now.similarity > self.best.0 {
            self.best = (self.now.similarity, self.student.snapshot());
        }
        if !self.held.is_empty() {
            let looks = watched(self.held);
            let labels: Vec<Option<usize>> = looks.iter().map(|look| Some(look.class.code() as usize)).collect();
            let answers = Answers::of(&mut engine, &looks);
            let own = answers.probabilities.iter().zip(&labels).map(|(p, l)| l.map_or(0.0, |l| p[l]));
            self.truth = mean(&margins(&answers, &labels)) + mean(&own.collect::<Vec<_>>());
        }
        Ok(())
    }

    /// Ends as every method does: with the statistics of the target.
    pub(crate) fn finish(mut self) -> Student {
        let looks = batch(self.sets.unlabelled, REFRESH, &mut self.rng);
        self.student.refresh(&looks);
        self.student
    }

    /// A move at random.
    pub(crate) fn any(&mut self) -> usize {
        let allowed = self.allowed();
        allowed.get(self.rng.random_range(0..allowed.len().max(1))).copied().unwrap_or(0)
    }

    /// Of some moves the one after which Δ_F was largest, made. All that were tried are paid for.
    pub(crate) fn make_best_of_some(&mut self) -> Result<(), TrainError> {
        let start = (self.student.snapshot(), self.momentum.clone(), self.now);
        let mut chosen = None;
        for _ in 0..TRIED {
            if self.over() {
                break;
            }
            let action = self.any();
            self.make(action)?;
            let better =
                chosen.as_ref().is_none_or(|(best, ..): &(Measured, _, _)| self.now.similarity > best.similarity);
            if better {
                chosen = Some((self.now, self.student.snapshot(), self.momentum.clone()));
            }
            self.student.restore(&start.0);
            self.momentum.clone_from(&start.1);
            self.now = start.2;
        }
        if let Some((now, snapshot, momentum)) = chosen {
            self.student.restore(&snapshot);
            (self.now, self.momentum) = (now, momentum);
        }
        Ok(())
    }

    /// One move while the agent learns: sometimes its choice, otherwise any.
    pub(crate) fn practise(&mut self, agent: &Agent, exploration: f64) -> Result<Memory, TrainError> {
        let state = self.state();
        let action = if self.rng.random_bool(exploration) { self.any() } else { agent.choose(&state, &self.allowed()) };
        let reward = self.make(action)?;
        Ok(Memory { state, action, reward, next: self.state(), allowed: self.allowed() })
    }

    /// Δ_F of what was held back, and the mean probability of its own classes: 2 at best, about.
    pub(crate) fn truth(&self) -> f32 {
        self.truth
    }
}

/// The class the decoder is sure of, if it is.
fn sure_of(logits: &[f32]) -> Option<usize> {
    let top = logits.iter().fold(f32::MIN, |m, v| m.max(*v));
    let sum: f32 = logits.iter().map(|l| (l - top).exp()).sum();
    (1.0 / sum >= SURE).then(|| logits.iter().position(|l| *l == top)).flatten()
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len().max(1) as f32
}
