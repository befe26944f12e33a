//! Power and force limiting: the arithmetic of ISO/TS 15066:2016, Annex A.
//!
//! Where arm and person may touch on purpose, in a hand-over or while one holds what the other works on,
//! not the distance is bounded but what a contact transfers. The contact is taken for two masses with the
//! spring of the body part between them: `v = F / sqrt(μ k)`, with the reduced mass
//! `μ = (1/m_H + 1/m_R)⁻¹` of the body part and of the arm, `m_R = M/2 + m_L`, half of what moves of the
//! arm and what it carries.

use tandem_msg::BodyPart;

/// What a part of the body bears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Force that may last, N; for a clamped part.
    pub quasi_static: f64,
    /// How much more a blow may have that the part can follow; 0 where none is allowed.
    pub transient_factor: f64,
    /// Spring of the part, N/m.
    pub stiffness: f64,
    /// Effective mass, kg.
    pub mass: f64,
}

/// The tolerance of a body part: Table A.2 for the force, Table A.3 for spring and mass. Of what a capsule covers
/// the most delicate counts: the face for the head, the abdomen for the trunk, the shin for a leg.
pub fn tolerance(part: BodyPart) -> Tolerance {
    let [quasi_static, transient_factor, stiffness, mass] = match part {
        BodyPart::Torso => [110.0, 2.0, 10e3, 40.0],
        BodyPart::Head => [65.0, 0.0, 75e3, 4.4],
        BodyPart::UpperArm => [150.0, 2.0, 30e3, 3.0],
        BodyPart::Forearm => [160.0, 2.0, 40e3, 2.0],
        BodyPart::Hand => [140.0, 2.0, 75e3, 0.6],
        BodyPart::Leg => [130.0, 2.0, 60e3, 75.0],
    };
    Tolerance { quasi_static, transient_factor, stiffness, mass }
}

/// Largest speed of the arm against a body part, m/s, of an arm of `moving_mass` kg that carries `load` kg.
/// `clamped` when the part cannot give way, so that the blow may not exceed what may last.
/// 0 where the part may not be touched at all, or a mass is not finite and above 0.
pub fn contact_speed_max(part: BodyPart, moving_mass: f64, load: f64, clamped: bool) -> f64 {
    let Tolerance { quasi_static, transient_factor, stiffness, mass } = tolerance(part);
    let arm = 0.5 * moving_mass + load.max(0.0);
    if arm <= 0.0 || !arm.is_finite() || load.is_nan() || transient_factor == 0.0 {
        return 0.0;
    }
    let reduced = 1.0 / (1.0 / mass + 1.0 / arm);
    let force = if clamped { quasi_static } else { quasi_static * transient_factor };
    force / (reduced * stiffness).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hand against an arm of 20 kg: μ = 0.566 kg, 140 N over sqrt(0.566 · 75 000) N/(m/s).
    #[test]
    fn a_hand_bears_what_the_formula_says() {
        let clamped = contact_speed_max(BodyPart::Hand, 20.0, 0.0, true);
        assert!((clamped - 0.6795).abs() < 1e-4, "{clamped}");
        assert!((contact_speed_max(BodyPart::Hand, 20.0, 0.0, false) - 2.0 * clamped).abs() < 1e-12);
    }

    /// More mass is never faster, the head is never touched, and no mass is no answer.
    #[test]
    fn heavier_is_slower() {
        for part in [BodyPart::Torso, BodyPart::UpperArm, BodyPart::Forearm, BodyPart::Hand, BodyPart::Leg] {
            let speeds = [1.0, 5.0, 20.0, 100.0].map(|mass| contact_speed_max(part, mass, 1.0, false));
            assert!(speeds.is_sorted_by(|a, b| a > b), "{part}: {speeds:?}");
            assert!(contact_speed_max(part, 20.0, 5.0, false) < contact_speed_max(part, 20.0, 0.0, false));
        }
        assert_eq!(contact_speed_max(BodyPart::Head, 20.0, 0.0, false), 0.0);
        for mass in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(contact_speed_max(BodyPart::Hand, mass, 0.0, false), 0.0);
        }
        assert_eq!(contact_speed_max(BodyPart::Hand, 20.0, f64::NAN, false), 0.0);
    }
}
