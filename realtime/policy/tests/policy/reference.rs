//! The equations as printed: plain loops, double precision, no skipping.

use tandem_policy::{ADAPTER, HIDDEN, Lateral, Shape};

/// The action, step by step as the equations have it; outputs past the shape's are absent.
pub(crate) fn reference(shape: &Shape, numbers: &[f32], observation: &[f32]) -> Vec<f64> {
    let mut rest = numbers.iter().map(|number| f64::from(*number));
    let mut take = |count: usize| -> Vec<f64> { rest.by_ref().take(count).collect() };
    let (mean, scale, step) = (take(shape.inputs), take(shape.inputs), take(shape.outputs));
    let x: Vec<f64> = (0..shape.inputs).map(|i| (f64::from(observation[i]) - mean[i]) * scale[i]).collect();
    let product = |x: &[f64], matrix: &[f64], width: usize| -> Vec<f64> {
        (0..width).map(|j| x.iter().enumerate().map(|(i, x)| x * matrix[i * width + j]).sum()).collect()
    };
    let rectified = |v: Vec<f64>| -> Vec<f64> { v.into_iter().map(|v| v.max(0.0)).collect() };
    let sum = |a: Vec<f64>, b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + b).collect() };

    // hidden[layer][column]
    let mut hidden: [Vec<Vec<f64>>; 2] = [Vec::new(), Vec::new()];
    let mut output = Vec::new();
    for column in 0..shape.columns {
        let mut below = x.clone();
        for (layer, width) in [HIDDEN, HIDDEN, shape.outputs].into_iter().enumerate() {
            let (weight, bias) = (take(below.len() * width), take(width));
            let mut sums = sum(product(&below, &weight, width), &bias);
            if layer > 0 && column > 0 {
                let seen = &hidden[layer - 1][..column];
                match shape.lateral {
                    Lateral::Linear => {
                        for h in seen {
                            sums = sum(sums, &product(h, &take(HIDDEN * width), width));
                        }
                    }
                    Lateral::Adapter => {
                        let alpha = take(column);
                        let all: Vec<f64> =
                            seen.iter().zip(&alpha).flat_map(|(h, alpha)| h.iter().map(move |h| alpha * h)).collect();
                        let adapter = rectified(product(&all, &take(column * HIDDEN * ADAPTER), ADAPTER));
                        sums = sum(sums, &product(&adapter, &take(ADAPTER * width), width));
                    }
                }
            }
            if layer == 2 {
                output = sums;
            } else {
                below = rectified(sums);
                hidden[layer].push(below.clone());
            }
        }
    }
    output.iter().zip(step).map(|(output, step)| step * output.tanh()).collect()
}
