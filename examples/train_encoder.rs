//! Launches training until the command line does.
use tandem::learning::encoder::{TrainOptions, TrainProgress, train};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let o = TrainOptions {
        samples: a[1].parse().unwrap(),
        epochs: a[2].parse().unwrap(),
        seed: a[3].parse().unwrap(),
        out: a[4].clone().into(),
        resume: a.len() > 5,
    };
    let t = std::time::Instant::now();
    let card = train(&o, &mut |p| match p {
        TrainProgress::Step(e, s, n, l) if s % 25 != 0 => {
            let _ = (e, n, l);
        }
        TrainProgress::Data(m, _) if m % 1000 != 0 => {}
        p => println!("{:7.1} {p:?}", t.elapsed().as_secs_f64()),
    });
    match card {
        Ok(c) => println!("{}", serde_json::to_string_pretty(&c).unwrap()),
        Err(e) => println!("{e}"),
    }
}
