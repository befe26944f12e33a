use std::time::Instant;
use tandem::learning::encoder::*;
use tandem::perception::*;
use tandem_msg::*;
fn main() {
    let mut s = Sampler::new();
    let mut c = Vec::new();
    let mut t = [0.0f64; 3];
    let n = 200u64;
    let mut agree = 0;
    let mut pos: Vec<Vec<f64>> = vec![vec![]; 8];
    let mut ax: Vec<Vec<f64>> = vec![vec![]; 8];
    let mut none = [0; 8];
    let mut dims: Vec<[Vec<f64>; 5]> = (0..8).map(|_| Default::default()).collect();
    let mut offp = 0.0;
    for i in 0..n * 8 {
        let b = Instant::now();
        let e = example(77, Split::Train, i, &mut s, &mut c);
        t[0] += b.elapsed().as_secs_f64();
        let b = Instant::now();
        let s2 = s.sample(&c).unwrap();
        t[1] += b.elapsed().as_secs_f64();
        agree += (s2 == e.sample) as u32;
        offp += e.segment.iter().filter(|x| **x).count() as f64;
        let b = Instant::now();
        let f = fit(&c, &e.sample, &e.segment, e.class);
        t[2] += b.elapsed().as_secs_f64();
        let k = e.class.code() as usize;
        if let Some(f) = f {
            let a = &e.camera_from_feature;
            let q = &f.camera_from_feature;
            pos[k].push((a.translation.vector - q.translation.vector).norm() * 1e3);
            ax[k].push((a * nalgebra::Vector3::z()).angle(&(q * nalgebra::Vector3::z())).to_degrees());
            let g = &e.feature;
            let d = &f.dimensions;
            for (j, (is, m)) in [
                (g.diameter, d.diameter),
                (g.depth, d.depth),
                (g.length, d.length),
                (g.width, d.width),
                (g.pitch, d.pitch),
            ]
            .iter()
            .enumerate()
            {
                if *is > 0.0 && m.value > 0.0 {
                    dims[k][j].push(m.value / is - 1.0)
                }
            }
        } else {
            none[k] += 1
        }
    }
    println!(
        "example {:.2} ms sample {:.2} ms fit {:.2} ms agree {agree} feature pts {:.0}",
        t[0] / (n * 8) as f64 * 1e3,
        t[1] / (n * 8) as f64 * 1e3,
        t[2] / (n * 8) as f64 * 1e3,
        offp / (n * 8) as f64
    );
    let q = |v: &mut Vec<f64>, p: f64| {
        if v.is_empty() {
            return f64::NAN;
        }
        v.sort_by(f64::total_cmp);
        v[((v.len() - 1) as f64 * p) as usize]
    };
    for k in 0..8 {
        print!(
            "{:>14} none {:3} pos mm {:.2} {:.2} axis {:.2} {:.2} |",
            FeatureClass::ALL[k].name(),
            none[k],
            q(&mut pos[k], 0.5),
            q(&mut pos[k], 0.9),
            q(&mut ax[k], 0.5),
            q(&mut ax[k], 0.9)
        );
        for j in 0..5 {
            let v = &mut dims[k][j];
            let n = v.len();
            print!(" {}n{} {:+.3}/{:.3}/{:.3}", ["D", "dep", "L", "W", "P"][j], n, q(v, 0.5), q(v, 0.1), q(v, 0.9));
        }
        println!();
    }
}
