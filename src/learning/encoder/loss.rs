//! What training minimises.

use candle_core::{D, Device, Result, Tensor};
use tandem_msg::{Coded, FEATURE_CLASSES};

use super::dataset::Example;
use super::train::SEGMENT_STRIDE;
use crate::perception::network::Output;

/// Share of the label spread over all classes.
const SMOOTHING: f32 = 0.05;
/// Weight of the segmentation.
const SEGMENT: f64 = 0.5;

/// Cross-entropy of smoothed class labels, and of the points' segment labels.
pub(crate) fn loss(output: &Output, examples: &[Example]) -> Result<Tensor> {
    let batch = examples.len();
    let mut labels = vec![SMOOTHING / FEATURE_CLASSES as f32; batch * FEATURE_CLASSES];
    for (b, example) in examples.iter().enumerate() {
        labels[b * FEATURE_CLASSES + example.class.code() as usize] += 1.0 - SMOOTHING;
    }
    let labels = Tensor::from_vec(labels, (batch, FEATURE_CLASSES), &Device::Cpu)?;
    let logits = &output.class_logits;
    let shifted = logits.broadcast_sub(&logits.max_keepdim(D::Minus1)?.detach())?;
    let log_sum = shifted.exp()?.sum_keepdim(D::Minus1)?.log()?;
    let class = (labels * shifted.broadcast_sub(&log_sum)?)?.sum_all()?.affine(-1.0 / batch as f64, 0.0)?;

    let marks: Vec<f32> = examples
        .iter()
        .flat_map(|e| e.segment.iter().step_by(SEGMENT_STRIDE).map(|s| f32::from(u8::from(*s))))
        .collect();
    let count = marks.len();
    let marks = Tensor::from_vec(marks, count, &Device::Cpu)?;
    // log(1 + exp(x)) − x·y, written so that neither end overflows.
    let x = &output.segment_logits;
    let soft = (x.relu()? + (x.abs()?.neg()?.exp()? + 1.0)?.log()?)?;
    let segment = (soft - (x * marks)?)?.mean_all()?;
    class + (segment * SEGMENT)?
}
