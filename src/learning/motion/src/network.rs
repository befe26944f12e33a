//! Progressive networks (Fig. 7, Eq. (16) and (17)), forwards and backwards over a batch.
//!
//! The numbers lie as [`tandem_policy::Shape`] says, so a trained actor is copied into a policy as it is.
//! Only the last column is trained. The earlier ones stand still, but the gradient goes *through* them: the
//! action, which a critic's first column sees as well, gets its part of it.

#![allow(clippy::needless_range_loop, reason = "an index here counts in several arrays at once")]

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_policy::{ADAPTER, HIDDEN, Lateral};

use crate::matrix::{product, transpose};

/// What α of Eq. (17) begins with: the earlier columns are heard from the start, quietly.
pub const ALPHA: f32 = 0.1;

/// Where one column's numbers lie.
#[derive(Clone, Copy, Debug)]
struct Column {
    index: usize,
    first: usize,
    second: usize,
    second_lateral: usize,
    third: usize,
    third_lateral: usize,
}

/// A network of one or more columns.
#[derive(Clone, Debug)]
pub struct Network {
    inputs: usize,
    outputs: usize,
    lateral: Lateral,
    columns: Vec<Column>,
    numbers: Vec<f32>,
}

/// What a forward pass over a batch leaves for the backward one.
#[derive(Clone, Debug, Default)]
pub struct Pass {
    batch: usize,
    input: Vec<f32>,
    /// Of each column, its two hidden layers, `batch × 256`.
    hidden: Vec<[Vec<f32>; 2]>,
    /// Of each column, its adapters into the second and the third layer, `batch × 64`.
    adapter: Vec<[Vec<f32>; 2]>,
    /// Of each column and layer, what each earlier column gives its adapter before α.
    given: Vec<[Vec<Vec<f32>>; 2]>,
    /// Outputs, `batch × outputs`.
    pub output: Vec<f32>,
    slope: Vec<[Vec<f32>; 2]>,
    adapter_slope: Vec<f32>,
    scratch: [Vec<f32>; 3],
}

fn lateral_numbers(lateral: Lateral, earlier: usize, width: usize) -> usize {
    match (earlier, lateral) {
        (0, _) => 0,
        (_, Lateral::Linear) => earlier * HIDDEN * width,
        (_, Lateral::Adapter) => earlier + earlier * HIDDEN * ADAPTER + ADAPTER * width,
    }
}

impl Network {
    /// One column, drawn: uniform within the bounds of He et al. (2015); the last layer small.
    pub fn new(inputs: usize, outputs: usize, lateral: Lateral, draws: &mut ChaCha8Rng) -> Self {
        let mut network = Self { inputs, outputs, lateral, columns: Vec::new(), numbers: Vec::new() };
        network.add_column(draws);
        network
    }

    /// Freezes what there is and adds a column that sees it.
    pub fn add_column(&mut self, draws: &mut ChaCha8Rng) {
        let earlier = self.columns.len();
        let first = self.numbers.len();
        let second = first + (self.inputs + 1) * HIDDEN;
        let second_lateral = second + (HIDDEN + 1) * HIDDEN;
        let third = second_lateral + lateral_numbers(self.lateral, earlier, HIDDEN);
        let third_lateral = third + (HIDDEN + 1) * self.outputs;
        let end = third_lateral + lateral_numbers(self.lateral, earlier, self.outputs);
        self.columns.push(Column { index: earlier, first, second, second_lateral, third, third_lateral });
        self.numbers.resize(end, 0.0);
        let mut draw = |numbers: &mut [f32], bound: f32| {
            for number in numbers {
                *number = (2.0 * draws.random::<f32>() - 1.0) * bound;
            }
        };
        let he = |inputs: usize| (6.0 / inputs as f32).sqrt();
        draw(&mut self.numbers[first..first + self.inputs * HIDDEN], he(self.inputs));
        draw(&mut self.numbers[second..second + HIDDEN * HIDDEN], he(HIDDEN));
        draw(&mut self.numbers[third..third + HIDDEN * self.outputs], 3e-3);
        for (from, width, share) in [(second_lateral, HIDDEN, 1.0), (third_lateral, self.outputs, 3e-3)] {
            if earlier == 0 {
                continue;
            }
            match self.lateral {
                Lateral::Linear => {
                    let count = earlier * HIDDEN * width;
                    draw(&mut self.numbers[from..from + count], ALPHA * share * he(HIDDEN));
                }
                Lateral::Adapter => {
                    self.numbers[from..from + earlier].fill(ALPHA);
                    let v = from + earlier;
                    let m = v + earlier * HIDDEN * ADAPTER;
                    draw(&mut self.numbers[v..m], he(HIDDEN));
                    draw(&mut self.numbers[m..m + ADAPTER * width], share * he(ADAPTER));
                }
            }
        }
    }

    /// Numbers of an input.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Columns.
    pub fn columns(&self) -> usize {
        self.columns.len()
    }

    /// How later columns see earlier ones.
    pub fn lateral(&self) -> Lateral {
        self.lateral
    }

    /// All numbers.
    pub fn numbers(&self) -> &[f32] {
        &self.numbers
    }

    /// Those of the column that is trained.
    pub fn trained(&self) -> &[f32] {
        &self.numbers[self.last().first..]
    }

    /// The same, to be changed.
    pub fn trained_mut(&mut self) -> &mut [f32] {
        let first = self.last().first;
        &mut self.numbers[first..]
    }

    /// Replaces all numbers, which must be as many.
    pub fn set_numbers(&mut self, numbers: &[f32]) {
        self.numbers.copy_from_slice(numbers);
    }

    /// Moves towards another network of the same shape by a share `tau`.
    pub fn follow(&mut self, other: &Self, tau: f32) {
        let first = self.last().first;
        for (own, new) in self.numbers[first..].iter_mut().zip(&other.numbers[first..]) {
            *own += tau * (new - *own);
        }
    }

    fn last(&self) -> &Column {
        &self.columns[self.columns.len() - 1]
    }

    /// Outputs for `input` (`batch × inputs`), left in `pass`.
    pub fn forward(&self, input: &[f32], pass: &mut Pass) {
        let batch = input.len() / self.inputs;
        pass.fit(self, batch);
        pass.input.copy_from_slice(input);
        for column in &self.columns {
            let k = column.index;
            let (earlier, rest) = pass.hidden.split_at_mut(k);
            let [first, second] = &mut rest[0];
            self.dense(first, &pass.input, column.first, self.inputs, HIDDEN);
            rectify(first);
            self.dense(second, first, column.second, HIDDEN, HIDDEN);
            let [into_second, into_third] = &mut pass.adapter[k];
            let [given_second, given_third] = &mut pass.given[k];
            self.see(second, column.second_lateral, HIDDEN, earlier, 0, into_second, given_second);
            rectify(second);
            if k + 1 == self.columns.len() {
                self.dense(&mut pass.output, second, column.third, HIDDEN, self.outputs);
                self.see(&mut pass.output, column.third_lateral, self.outputs, earlier, 1, into_third, given_third);
            }
        }
    }

    fn dense(&self, out: &mut [f32], x: &[f32], at: usize, depth: usize, width: usize) {
        let bias = &self.numbers[at + depth * width..at + (depth + 1) * width];
        for row in out.chunks_exact_mut(width) {
            row.copy_from_slice(bias);
        }
        product(out, x, &self.numbers[at..at + depth * width], depth, width, true);
    }

    /// Adds what a column sees of a hidden layer of the earlier ones.
    #[allow(clippy::too_many_arguments, reason = "the places of one lateral connection")]
    fn see(
        &self,
        out: &mut [f32],
        at: usize,
        width: usize,
        earlier: &[[Vec<f32>; 2]],
        layer: usize,
        adapter: &mut [f32],
        given: &mut [Vec<f32>],
    ) {
        let count = earlier.len();
        if count == 0 {
            return;
        }
        match self.lateral {
            // Eq. (16): M of each earlier column.
            Lateral::Linear => {
                for (j, hidden) in earlier.iter().enumerate() {
                    let m = at + j * HIDDEN * width;
                    product(out, &hidden[layer], &self.numbers[m..m + HIDDEN * width], HIDDEN, width, true);
                }
            }
            // Eq. (17): M σ(V α h).
            Lateral::Adapter => {
                let m = at + count + count * HIDDEN * ADAPTER;
                adapter.fill(0.0);
                for (j, hidden) in earlier.iter().enumerate() {
                    let v = at + count + j * HIDDEN * ADAPTER;
                    let weights = &self.numbers[v..v + HIDDEN * ADAPTER];
                    product(&mut given[j], &hidden[layer], weights, HIDDEN, ADAPTER, false);
                    let alpha = self.numbers[at + j];
                    for (sum, given) in adapter.iter_mut().zip(&given[j]) {
                        *sum += alpha * given;
                    }
                }
                rectify(adapter);
                product(out, adapter, &self.numbers[m..m + ADAPTER * width], ADAPTER, width, true);
            }
        }
    }

    /// Gradients of a loss whose slope by the outputs is `slope` (`batch × outputs`), after [`Network::forward`]
    /// on the same pass: by the trained numbers into `by_numbers`, and by the inputs from `inputs_from` on
    /// into `by_inputs` (`batch` rows), each where it is asked for.
    pub fn backward(
        &self,
        slope: &[f32],
        pass: &mut Pass,
        mut by_numbers: Option<&mut [f32]>,
        by_inputs: Option<(usize, &mut [f32])>,
    ) {
        let count = self.columns.len();
        let base = self.last().first;
        if let Some(gradient) = by_numbers.as_deref_mut() {
            gradient.fill(0.0);
        }
        for slopes in pass.slope.iter_mut().flatten() {
            slopes.fill(0.0);
        }
        // Nothing but the inputs needs the gradient in the frozen columns.
        let through = by_inputs.is_some();
        self.unsee(
            slope,
            self.last().third_lateral,
            self.outputs,
            count - 1,
            1,
            pass,
            by_numbers.as_deref_mut(),
            through,
        );
        let last = self.last();
        {
            let Pass { hidden, slope: slopes, scratch, .. } = pass;
            let gradient = by_numbers.as_deref_mut().map(|g| &mut g[last.third - base..last.third_lateral - base]);
            let weights = &self.numbers[last.third..last.third + HIDDEN * self.outputs];
            undense(
                slope,
                &hidden[count - 1][1],
                weights,
                gradient,
                Some(&mut slopes[count - 1][1]),
                self.outputs,
                scratch,
            );
        }
        let mut by_inputs = by_inputs;
        for column in self.columns.iter().rev() {
            let k = column.index;
            let trained = k + 1 == count;
            if !trained && !through {
                break;
            }
            let mut own = std::mem::take(&mut pass.slope[k][1]);
            mask(&mut own, &pass.hidden[k][1]);
            let gradient = if trained { by_numbers.as_deref_mut() } else { None };
            self.unsee(&own, column.second_lateral, HIDDEN, k, 0, pass, gradient, through);
            {
                let Pass { hidden, slope: slopes, scratch, .. } = &mut *pass;
                let gradient = by_numbers
                    .as_deref_mut()
                    .filter(|_| trained)
                    .map(|g| &mut g[column.second - base..column.second_lateral - base]);
                let weights = &self.numbers[column.second..column.second + HIDDEN * HIDDEN];
                undense(&own, &hidden[k][0], weights, gradient, Some(&mut slopes[k][0]), HIDDEN, scratch);
            }
            pass.slope[k][1] = own;
            let mut own = std::mem::take(&mut pass.slope[k][0]);
            mask(&mut own, &pass.hidden[k][0]);
            {
                let Pass { input, scratch, .. } = &mut *pass;
                let gradient = by_numbers
                    .as_deref_mut()
                    .filter(|_| trained)
                    .map(|g| &mut g[column.first - base..column.second - base]);
                let weights = &self.numbers[column.first..column.first + self.inputs * HIDDEN];
                undense(&own, input, weights, gradient, None, HIDDEN, scratch);
                if let Some((from, out)) = &mut by_inputs {
                    let wanted = self.inputs - *from;
                    transpose(&weights[*from * HIDDEN..], HIDDEN, &mut scratch[1]);
                    product(out, &own, &scratch[1], HIDDEN, wanted, !trained);
                }
            }
            pass.slope[k][0] = own;
        }
    }

    /// The backward of [`Network::see`].
    #[allow(clippy::too_many_arguments, reason = "the places of one lateral connection")]
    fn unsee(
        &self,
        slope: &[f32],
        at: usize,
        width: usize,
        count: usize,
        layer: usize,
        pass: &mut Pass,
        mut by_numbers: Option<&mut [f32]>,
        through: bool,
    ) {
        if count == 0 {
            return;
        }
        let base = self.last().first;
        let Pass { hidden, adapter, given, slope: slopes, adapter_slope, scratch, .. } = pass;
        match self.lateral {
            Lateral::Linear => {
                for j in 0..count {
                    let m = at + j * HIDDEN * width;
                    let weights = &self.numbers[m..m + HIDDEN * width];
                    let gradient = by_numbers.as_deref_mut().map(|g| &mut g[m - base..m - base + HIDDEN * width]);
                    let onward = through.then_some(&mut slopes[j][layer]);
                    undense(slope, &hidden[j][layer], weights, gradient, onward, width, scratch);
                }
            }
            Lateral::Adapter => {
                let m = at + count + count * HIDDEN * ADAPTER;
                let adapter = &adapter[count][layer];
                adapter_slope.clear();
                adapter_slope.resize(adapter.len(), 0.0);
                let gradient = by_numbers.as_deref_mut().map(|g| &mut g[m - base..m - base + ADAPTER * width]);
                let weights = &self.numbers[m..m + ADAPTER * width];
                undense(slope, adapter, weights, gradient, Some(adapter_slope), width, scratch);
                mask(adapter_slope, adapter);
                for j in 0..count {
                    let alpha = self.numbers[at + j];
                    let v = at + count + j * HIDDEN * ADAPTER;
                    if let Some(gradient) = by_numbers.as_deref_mut() {
                        gradient[at + j - base] =
                            adapter_slope.iter().zip(&given[count][layer][j]).map(|(a, b)| a * b).sum();
                    }
                    let scaled: &mut Vec<f32> = &mut given[count][layer][j];
                    for (to, slope) in scaled.iter_mut().zip(adapter_slope.iter()) {
                        *to = alpha * slope;
                    }
                    let gradient = by_numbers.as_deref_mut().map(|g| &mut g[v - base..v - base + HIDDEN * ADAPTER]);
                    let onward = through.then_some(&mut slopes[j][layer]);
                    let weights = &self.numbers[v..v + HIDDEN * ADAPTER];
                    undense(scaled, &hidden[j][layer], weights, gradient, onward, ADAPTER, scratch);
                }
            }
        }
    }
}

/// Backward of one matrix: the gradient by it (and by a bias that follows it, where there is room for one),
/// and the slope by what came in, added to `onward`.
fn undense(
    slope: &[f32],
    x: &[f32],
    weights: &[f32],
    gradient: Option<&mut [f32]>,
    onward: Option<&mut Vec<f32>>,
    width: usize,
    scratch: &mut [Vec<f32>; 3],
) {
    let depth = weights.len() / width;
    let batch = slope.len() / width;
    if let Some(gradient) = gradient {
        transpose(x, depth, &mut scratch[0]);
        let (matrix, bias) = gradient.split_at_mut(depth * width);
        product(matrix, &scratch[0], slope, batch, width, true);
        if bias.len() == width {
            for row in slope.chunks_exact(width) {
                for (sum, slope) in bias.iter_mut().zip(row) {
                    *sum += slope;
                }
            }
        }
    }
    if let Some(onward) = onward {
        transpose(weights, width, &mut scratch[2]);
        product(onward, slope, &scratch[2], width, depth, true);
    }
}

fn rectify(values: &mut [f32]) {
    for value in values {
        *value = value.max(0.0);
    }
}

/// The slope of the rectifier.
fn mask(slope: &mut [f32], value: &[f32]) {
    for (slope, value) in slope.iter_mut().zip(value) {
        *slope = if *value > 0.0 { *slope } else { 0.0 };
    }
}

impl Pass {
    fn fit(&mut self, network: &Network, batch: usize) {
        let count = network.columns.len();
        if self.batch == batch && self.hidden.len() == count && self.output.len() == batch * network.outputs {
            return;
        }
        let layers = |width: usize| vec![[vec![0.0; batch * width], vec![0.0; batch * width]]; count];
        self.batch = batch;
        self.input = vec![0.0; batch * network.inputs];
        self.hidden = layers(HIDDEN);
        self.slope = layers(HIDDEN);
        self.adapter = layers(ADAPTER);
        self.given = (0..count).map(|k| [0, 1].map(|_| vec![vec![0.0; batch * ADAPTER]; k])).collect();
        self.output = vec![0.0; batch * network.outputs];
    }
}
