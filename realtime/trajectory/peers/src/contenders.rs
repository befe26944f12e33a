//! Each library behind one face, with its inputs already set.

use crate::{cpp, inputs::Problem};
use rsruckig::prelude as port;
use std::hint::black_box;
use tandem_trajectory::{Cursor, Input, Interface, Trajectory};

/// A library with a list of inputs. What is timed is `calculate`, `at_random` and `at_rising`.
pub trait Contender {
    fn name(&self) -> &'static str;
    fn calculate(&mut self, index: usize);
    /// The duration of the last trajectory, if there is one.
    fn duration(&self) -> Option<f64>;
    /// States of all joints at each of `times`.
    fn at_random(&mut self, times: &[f64]);
    /// The same at rising times.
    fn at_rising(&mut self, times: &[f64]) {
        self.at_random(times);
    }
}

pub struct Tandem<const N: usize> {
    inputs: Vec<Input<N>>,
    trajectory: Trajectory<N>,
    solved: bool,
}

impl<const N: usize> Tandem<N> {
    pub fn new(problems: &[[Problem; N]], velocity: bool) -> Self {
        let interface = [if velocity { Interface::Velocity } else { Interface::Position }; N];
        let input = |problems: &[Problem; N]| Input {
            start: problems.map(|problem| problem.start),
            target: problems.map(|problem| problem.target),
            limits: problems.map(|problem| problem.limits),
            interface,
            ..Input::default()
        };
        let inputs: Vec<Input<N>> = problems.iter().map(input).collect();
        Tandem { inputs, trajectory: Trajectory::default(), solved: false }
    }
}

impl<const N: usize> Contender for Tandem<N> {
    fn name(&self) -> &'static str {
        "tandem-trajectory"
    }

    fn calculate(&mut self, index: usize) {
        self.solved = self.trajectory.recalculate(black_box(&self.inputs[index])).is_ok();
    }

    fn duration(&self) -> Option<f64> {
        self.solved.then(|| self.trajectory.duration())
    }

    fn at_random(&mut self, times: &[f64]) {
        for time in times {
            black_box(&self.trajectory.at(*black_box(time)));
        }
    }

    fn at_rising(&mut self, times: &[f64]) {
        let mut cursor = Cursor::default();
        for time in times {
            black_box(&cursor.at(&self.trajectory, *black_box(time)));
        }
    }
}

/// ruckig's C++, built with -O3.
pub struct Cpp {
    solver: cpp::Solver,
    inputs: Vec<cpp::Input>,
    solved: bool,
}

impl Cpp {
    pub fn new<const N: usize>(problems: &[[Problem; N]], velocity: bool) -> Self {
        let numbers = |Problem { start, target, limits }: Problem| {
            let (p, q) = (start, target);
            let states = [p.position, p.velocity, p.acceleration, q.position, q.velocity, q.acceleration];
            let [a, b, c, d, e, f] = states;
            [a, b, c, d, e, f, limits.velocity_max, limits.acceleration_max, limits.jerk_max]
        };
        let input = |problems: &[Problem; N]| cpp::Input::new(&problems.map(numbers), velocity);
        Cpp { solver: cpp::Solver::new(N), inputs: problems.iter().map(input).collect(), solved: false }
    }
}

impl Contender for Cpp {
    fn name(&self) -> &'static str {
        "ruckig C++ -O3"
    }

    fn calculate(&mut self, index: usize) {
        self.solved = self.solver.calculate(black_box(&self.inputs[index])) == 0;
    }

    fn duration(&self) -> Option<f64> {
        self.solved.then(|| self.solver.duration())
    }

    fn at_random(&mut self, times: &[f64]) {
        for time in times {
            black_box(self.solver.at(*black_box(time)));
        }
    }
}

/// The official crate, which binds that C++.
pub struct Binding {
    solver: ruckig::Ruckig,
    inputs: Vec<ruckig::InputParameter>,
    trajectory: ruckig::Trajectory,
    solved: bool,
}

impl Binding {
    pub fn new<const N: usize>(problems: &[[Problem; N]], velocity: bool) -> Self {
        let input = |problems: &[Problem; N]| {
            let each = |value: fn(&Problem) -> f64| problems.iter().map(value).collect::<Vec<f64>>();
            let mut input = ruckig::InputParameter::new(N);
            input.control_interface =
                if velocity { ruckig::ControlInterface::Velocity } else { ruckig::ControlInterface::Position };
            input.current_position = each(|problem| problem.start.position);
            input.current_velocity = each(|problem| problem.start.velocity);
            input.current_acceleration = each(|problem| problem.start.acceleration);
            input.target_position = each(|problem| problem.target.position);
            input.target_velocity = each(|problem| problem.target.velocity);
            input.target_acceleration = each(|problem| problem.target.acceleration);
            input.max_velocity = each(|problem| problem.limits.velocity_max);
            input.max_acceleration = each(|problem| problem.limits.acceleration_max);
            input.max_jerk = each(|problem| problem.limits.jerk_max);
            input
        };
        Binding {
            solver: ruckig::Ruckig::new_direct_and_offline(N),
            inputs: problems.iter().map(input).collect(),
            trajectory: ruckig::Trajectory::new_direct(N),
            solved: false,
        }
    }
}

impl Contender for Binding {
    fn name(&self) -> &'static str {
        "ruckig crate"
    }

    fn calculate(&mut self, index: usize) {
        let result = self.solver.calculate(black_box(&mut self.inputs[index]), &mut self.trajectory);
        self.solved = result == ruckig::Result::Working;
    }

    fn duration(&self) -> Option<f64> {
        self.solved.then(|| self.trajectory.get_duration())
    }

    fn at_random(&mut self, times: &[f64]) {
        for time in times {
            black_box(&self.trajectory.at_time(*black_box(time)));
        }
    }
}

/// rsruckig, a port to Rust.
pub struct Port<const N: usize> {
    solver: port::Ruckig<N, port::ThrowErrorHandler>,
    inputs: Vec<port::InputParameter<N>>,
    trajectory: port::Trajectory<N>,
    solved: bool,
    outputs: [port::DataArrayOrVec<f64, N>; 3],
}

impl<const N: usize> Port<N> {
    pub fn new(problems: &[[Problem; N]], velocity: bool) -> Self {
        let input = |problems: &[Problem; N]| {
            let mut input = port::InputParameter::new(None);
            input.control_interface =
                if velocity { port::ControlInterface::Velocity } else { port::ControlInterface::Position };
            for (index, problem) in problems.iter().enumerate() {
                input.current_position[index] = problem.start.position;
                input.current_velocity[index] = problem.start.velocity;
                input.current_acceleration[index] = problem.start.acceleration;
                input.target_position[index] = problem.target.position;
                input.target_velocity[index] = problem.target.velocity;
                input.target_acceleration[index] = problem.target.acceleration;
                input.max_velocity[index] = problem.limits.velocity_max;
                input.max_acceleration[index] = problem.limits.acceleration_max;
                input.max_jerk[index] = problem.limits.jerk_max;
            }
            input
        };
        Port {
            solver: port::Ruckig::new(None, 1e-3),
            inputs: problems.iter().map(input).collect(),
            trajectory: port::Trajectory::new(None),
            solved: false,
            outputs: [(); 3].map(|()| port::DataArrayOrVec::new(None, 0.0)),
        }
    }
}

impl<const N: usize> Contender for Port<N> {
    fn name(&self) -> &'static str {
        "rsruckig"
    }

    fn calculate(&mut self, index: usize) {
        self.solved = self.solver.calculate(black_box(&self.inputs[index]), &mut self.trajectory).is_ok();
    }

    fn duration(&self) -> Option<f64> {
        self.solved.then(|| self.trajectory.get_duration())
    }

    fn at_random(&mut self, times: &[f64]) {
        let [position, velocity, acceleration] = &mut self.outputs;
        for time in times {
            self.trajectory.at_time(
                *black_box(time),
                &mut Some(&mut *position),
                &mut Some(&mut *velocity),
                &mut Some(&mut *acceleration),
                &mut None,
                &mut None,
            );
            black_box((&*position, &*velocity, &*acceleration));
        }
    }
}
