//! Reads cases.csv: a sample of cases solved by ruckig's C++, with the durations it found and, where
//! a symmetry of the problem proves that a shorter one exists, that.

use tandem_trajectory::{Input, Interface, Limits, State, Synchronization};

/// One problem and what is known about it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Case {
    pub(crate) id: usize,
    pub(crate) tag: String,
    pub(crate) interface: Interface,
    pub(crate) synchronization: Synchronization,
    pub(crate) step: f64,
    pub(crate) minimum: f64,
    /// ruckig's result code.
    pub(crate) code: i32,
    /// Its duration, and whether an independent check in extended precision confirmed it.
    pub(crate) duration: f64,
    pub(crate) verified: bool,
    pub(crate) straight: bool,
    pub(crate) joints: Vec<JointCase>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct JointCase {
    pub(crate) start: State,
    pub(crate) target: State,
    pub(crate) limits: Limits,
    pub(crate) minimum: f64,
    /// A shorter minimum that a symmetry proves.
    pub(crate) best: Option<f64>,
}

impl Case {
    pub(crate) fn input<const N: usize>(&self) -> Input<N> {
        let mut input = Input { minimum_duration: self.minimum, duration_step: self.step, ..Input::default() };
        for (index, joint) in self.joints.iter().enumerate() {
            input.start[index] = joint.start;
            input.target[index] = joint.target;
            input.limits[index] = joint.limits;
            input.interface[index] = self.interface;
            input.synchronization[index] = self.synchronization;
        }
        input
    }
}

pub(crate) fn load() -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    let mut lines = include_str!("cases.csv").lines();
    let columns: Vec<&str> = lines.next().expect("a header").split(',').collect();
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        let text = |name: &str| fields[columns.iter().position(|column| *column == name).expect(name)];
        let number = |name: &str, default: f64| match text(name) {
            "" => default,
            value => value.parse::<f64>().unwrap_or_else(|_| panic!("{name} in {line}")),
        };
        if number("dof", 0.0) == 0.0 {
            cases.push(Case {
                id: number("case", 0.0) as usize,
                tag: text("tag").into(),
                interface: if text("iface") == "1" { Interface::Velocity } else { Interface::Position },
                synchronization: match text("sync") {
                    "1" => Synchronization::TimeIfNecessary,
                    "2" => Synchronization::Phase,
                    "3" => Synchronization::None,
                    _ => Synchronization::Time,
                },
                step: if text("disc") == "1" { number("dt", 0.0) } else { 0.0 },
                minimum: number("min_dur", 0.0),
                code: number("res_cpp", 0.0) as i32,
                duration: number("t_sync", f64::NAN),
                verified: text("verified") == "2",
                straight: text("phase_ok") == "1",
                joints: Vec::new(),
            });
        }
        let state = |p: &str, v: &str, a: &str| State {
            position: number(p, 0.0),
            velocity: number(v, 0.0),
            acceleration: number(a, 0.0),
        };
        let (v, a, j) = (number("vmax", f64::NAN), number("amax", f64::NAN), number("jmax", f64::NAN));
        let limits = Limits {
            velocity_min: number("vmin", -v),
            acceleration_min: number("amin", -a),
            ..Limits::symmetric(v, a, j)
        };
        let best = number("t_min_best", f64::NAN);
        cases.last_mut().expect("joint 0 comes first").joints.push(JointCase {
            start: state("p0", "v0", "a0"),
            target: state("pf", "vf", "af"),
            limits,
            minimum: number("t_min", f64::NAN),
            best: (!best.is_nan()).then_some(best),
        });
    }
    cases
}
