//! The reference table (Fig. 4): feature and parameters to assembly mode and tool.

use tandem_config::{AssemblyMode, ReferenceRow};
use tandem_msg::{FeatureClass, Tool};

/// What is known of a feature and its part when the table is consulted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Class of the feature.
    pub class: FeatureClass,
    /// Measured diameter, metres; 0 where the class has none.
    pub diameter: f64,
    /// Measured length, metres; 0 where the class has none.
    pub length: f64,
    /// Whether the part is oily, from the properties file.
    pub oily: bool,
    /// Whether the part bends.
    pub flexible: bool,
}

/// How a part is joined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joining {
    /// Mode.
    pub mode: AssemblyMode,
    /// Tool.
    pub tool: Tool,
    /// Torque (Nm) or force (N) of the final action.
    pub effort: f64,
}

/// The first row that fits, or `None`: then nothing is assumed and a person is asked.
pub fn join(table: &[ReferenceRow], seen: &Seen) -> Option<Joining> {
    let fits = |row: &&ReferenceRow| {
        row.class == seen.class
            && row.diameter.contains(seen.diameter)
            && row.length.contains(seen.length)
            && row.oily.is_none_or(|oily| oily == seen.oily)
            && row.flexible.is_none_or(|flexible| flexible == seen.flexible)
            // Whatever the file says: suction does not hold an oily part.
            && !(seen.oily && row.tool == Tool::VacuumGripper)
    };
    let row = table.iter().find(fits)?;
    Some(Joining { mode: row.mode, tool: row.tool, effort: row.effort })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::library::tests::shipped;
    use tandem_msg::Coded;

    /// Every class, oily or not, flexible or not, has a mode and a tool in the shipped table,
    /// and an oily part never gets suction.
    #[test]
    fn the_shipped_table_is_complete() {
        let cell = shipped();
        for &class in FeatureClass::ALL {
            for (oily, flexible) in [(false, false), (false, true), (true, false), (true, true)] {
                for diameter in [0.0, 0.004, 0.010, 0.0105, 0.02, 0.1] {
                    let seen = Seen { class, diameter, length: 0.05, oily, flexible };
                    let joining = join(&cell.reference, &seen);
                    assert!(joining.is_some(), "{seen:?}");
                    assert!(!oily || joining.is_some_and(|found| found.tool != Tool::VacuumGripper), "{seen:?}");
                }
            }
        }
    }

    #[test]
    fn a_measurement_that_is_not_finite_fits_no_row() {
        let cell = shipped();
        let seen = Seen { class: FeatureClass::Cone, diameter: f64::NAN, length: 0.0, oily: false, flexible: false };
        assert_eq!(join(&cell.reference, &seen), None);
    }

    #[test]
    fn the_diameter_decides_between_press_and_insert() {
        let cell = shipped();
        let pin = |diameter| {
            let seen = Seen { class: FeatureClass::SmoothAxis, diameter, length: 0.0, oily: false, flexible: false };
            join(&cell.reference, &seen).map(|joining| (joining.mode, joining.tool))
        };
        assert_eq!(pin(0.008), Some((AssemblyMode::Press, Tool::PressTool)));
        assert_eq!(pin(0.020), Some((AssemblyMode::Insert, Tool::ParallelGripper)));
    }
}
