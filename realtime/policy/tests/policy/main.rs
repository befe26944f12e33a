//! Policies against the equations, written out in double precision.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]

mod random;
mod reference;

use proptest::prelude::*;
use random::{noise, random};
use reference::reference;
use tandem_cycle::guard::{CountingAllocator, counted};
use tandem_policy::{Activations, COLUMNS_MAX, Lateral, NotFinite, Policy, Shape, ShapeError};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn shape() -> impl Strategy<Value = Shape> {
    let lateral = prop_oneof![Just(Lateral::Linear), Just(Lateral::Adapter)];
    (1..=128_usize, 1..=8_usize, 1..=COLUMNS_MAX, lateral).prop_map(|(inputs, outputs, columns, lateral)| Shape {
        inputs,
        outputs,
        columns,
        lateral,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Any shape, any weights: Eq. (16) and (17) as printed, on vectors of either width to the same
    /// bits, whatever was worked out before in the same room, and without an allocation.
    #[test]
    fn a_step_is_the_equations(shape in shape(), seed in any::<u64>()) {
        let numbers = random(&shape, seed);
        let policy = Policy::new(shape, &numbers).expect("as many numbers as the shape has");
        let observation: Vec<f32> = (0..shape.inputs).map(|index| 2.0 * noise(!seed, index)).collect();
        let mut room = Activations::default();
        let (mut action, mut narrow, mut again) = ([0.0; 8], [0.0; 8], [0.0; 8]);
        let outputs = ..shape.outputs;
        let (done, calls) = counted(|| policy.act(&mut room, &observation, &mut action[outputs]));
        prop_assert_eq!(done, Ok(()));
        prop_assert!(calls.is_none(), "{calls:?}");
        policy.narrow().act(&mut room, &observation, &mut narrow[outputs]).expect("the same observation");
        policy.act(&mut Activations::default(), &observation, &mut again[outputs]).expect("the same observation");
        prop_assert_eq!(action.map(f32::to_bits), narrow.map(f32::to_bits));
        prop_assert_eq!(action.map(f32::to_bits), again.map(f32::to_bits));
        for (joint, (found, wanted)) in action.iter().zip(reference(&shape, &numbers, &observation)).enumerate() {
            prop_assert!((f64::from(*found) - wanted).abs() < 2e-5, "joint {joint}: {found}, not {wanted}");
        }
    }

    /// What is no number is no action.
    #[test]
    fn a_lost_observation_moves_nothing(at in 0..20_usize, lost in prop_oneof![Just(f32::NAN), Just(f32::INFINITY)]) {
        let shape = Shape { inputs: 20, outputs: 6, columns: 2, lateral: Lateral::Adapter };
        let numbers = random(&shape, 1);
        let policy = Policy::new(shape, &numbers).expect("as many numbers as the shape has");
        let mut observation = [0.5; 20];
        observation[at] = lost;
        let mut action = [1.0; 6];
        prop_assert_eq!(policy.act(&mut Activations::default(), &observation, &mut action), Err(NotFinite));
        prop_assert_eq!(action, [0.0; 6]);
    }
}

/// An observation of another size, and weights that overflow, are refused alike.
#[test]
fn what_cannot_be_worked_out_moves_nothing() {
    let shape = Shape { inputs: 4, outputs: 2, columns: 1, lateral: Lateral::Linear };
    let mut numbers = random(&shape, 1);
    let mut action = [1.0; 2];
    let policy = Policy::new(shape, &numbers).expect("as many numbers as the shape has");
    assert_eq!(policy.act(&mut Activations::default(), &[0.0; 3], &mut action), Err(NotFinite));
    assert_eq!(action, [0.0; 2]);
    numbers[10..].fill(1e38);
    numbers[8..10].fill(1e38);
    let policy = Policy::new(shape, &numbers).expect("finite");
    action = [1.0; 2];
    let _ = policy.act(&mut Activations::default(), &[1e38; 4], &mut action);
    assert!(action.iter().all(|number| number.is_finite()), "{action:?}");
}

/// An earlier column goes on to act as it did alone: a later one only reads it.
#[test]
fn a_new_column_leaves_the_old_ones_alone() {
    let shape = |columns| Shape { inputs: 12, outputs: 6, columns, lateral: Lateral::Adapter };
    let two = random(&shape(2), 5);
    let alone = &two[..shape(1).numbers().expect("a shape")];
    let observation: Vec<f32> = (0..12).map(|index| noise(9, index)).collect();
    let mut action = [0.0; 6];
    let policy = Policy::new(shape(1), alone).expect("the first column stands first");
    policy.act(&mut Activations::default(), &observation, &mut action).expect("finite");
    for (found, wanted) in action.iter().zip(reference(&shape(1), alone, &observation)) {
        assert!((f64::from(*found) - wanted).abs() < 2e-5, "{found}, not {wanted}");
    }
}

/// Whole messages of what is no policy.
#[test]
fn what_is_no_policy_is_refused() {
    let shape = Shape { inputs: 3, outputs: 6, columns: 1, lateral: Lateral::Linear };
    let refused = |shape: Shape, numbers: &[f32]| Policy::new(shape, numbers).expect_err("refused").to_string();
    assert_eq!(refused(Shape { inputs: 0, ..shape }, &[]), "a policy has 0 inputs, allowed 1..=128");
    assert_eq!(refused(Shape { outputs: 9, ..shape }, &[]), "a policy has 9 outputs, allowed 1..=8");
    assert_eq!(refused(Shape { columns: 5, ..shape }, &[]), "a policy has 5 columns, allowed 1..=4");
    assert_eq!(refused(shape, &[0.0; 7]), "a policy of this shape has 68370 numbers, found 7");
    let mut numbers = vec![0.0; shape.numbers().expect("a shape")];
    numbers[41] = f32::NAN;
    assert_eq!(Policy::new(shape, &numbers).expect_err("refused"), ShapeError::NotFinite { index: 41 });
    assert_eq!(refused(shape, &numbers), "number 41 of a policy is not finite");
}
