//! Poses, Jacobians and inverse kinematics by crate `k`. Usage: FOLDER; reads FOLDER/ROBOT_chain.csv and
//! FOLDER/ROBOT_fk.csv, then answers nanoseconds a call for each line "ROBOT CASE".

use std::hint::black_box;
use std::io::BufRead;
use std::time::Instant;

use k::nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use k::{Constraints, InverseKinematicsSolver, JacobianIkSolver, JointType, Node, NodeBuilder, SerialChain};

fn rows(folder: &str, file: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(format!("{folder}/{file}")).expect("reference data");
    let number = |field: &str| field.parse().unwrap_or(f64::NAN);
    text.lines().skip(1).map(|line| line.split(',').map(number).collect()).collect()
}

struct Robot {
    chain: SerialChain<f64>,
    positions: Vec<Vec<f64>>,
}

impl Robot {
    fn read(folder: &str, name: &str) -> Self {
        let rows_of_chain = rows(folder, &format!("{name}_chain.csv"));
        let count = rows_of_chain.len() - 1;
        // Nodes hold their parents weakly: all have to live until the chain holds them.
        let mut nodes: Vec<Node<f64>> = Vec::new();
        for (index, row) in rows_of_chain.iter().enumerate() {
            let kind = if index < count {
                JointType::Rotational { axis: Unit::new_normalize(Vector3::new(row[8], row[9], row[10])) }
            } else {
                JointType::Fixed
            };
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(row[7], row[4], row[5], row[6]));
            let node: Node<f64> = NodeBuilder::new()
                .name(&format!("joint{index}"))
                .joint_type(kind)
                .translation(Translation3::new(row[1], row[2], row[3]))
                .rotation(rotation)
                .finalize()
                .into();
            if let Some(parent) = nodes.last() {
                node.set_parent(parent);
            }
            nodes.push(node);
        }
        let chain = SerialChain::from_end(nodes.last().expect("a robot has joints"));
        let positions = rows(folder, &format!("{name}_fk.csv")).iter().map(|row| row[..count].to_vec()).collect();
        assert_eq!(chain.dof(), count, "{name}");
        Self { chain, positions }
    }

    fn pose(&self, position: &[f64]) -> Isometry3<f64> {
        self.chain.set_joint_positions_unchecked(position);
        self.chain.end_transform()
    }

    fn round(&self, case: &str) -> f64 {
        let solver = JacobianIkSolver::default();
        let goals: Vec<Isometry3<f64>> = self.positions.iter().map(|q| self.pose(q)).collect();
        let begin = Instant::now();
        for (position, goal) in self.positions.iter().zip(&goals) {
            match case {
                "forward" => drop(black_box(self.pose(black_box(position)))),
                "jacobian" => {
                    black_box(self.pose(black_box(position)));
                    black_box(k::jacobian(&self.chain));
                }
                _ => {
                    let seed: Vec<f64> = (0..position.len())
                        .map(|k| position[k] + if k % 2 == 0 { 0.2 } else { -0.2 })
                        .collect();
                    self.chain.set_joint_positions_unchecked(&seed);
                    let _ = black_box(solver.solve_with_constraints(&self.chain, goal, &Constraints::default()));
                }
            }
        }
        begin.elapsed().as_nanos() as f64 / self.positions.len() as f64
    }
}

fn main() {
    let folder = std::env::args().nth(1).expect("the folder of the reference data");
    let robots = ["ur5", "panda"].map(|name| (name, Robot::read(&folder, name)));
    println!("ready");
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let (name, case) = line.split_once(' ').expect("a robot and a case");
        let (_, robot) = robots.iter().find(|(known, _)| *known == name).expect("a known robot");
        let least = (0..5).map(|_| robot.round(case)).fold(f64::INFINITY, f64::min);
        println!("{least}");
    }
}
