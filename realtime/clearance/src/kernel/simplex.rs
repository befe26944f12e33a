//! The nearest point to the origin of up to four points: a point, segment, triangle or tetrahedron.
//!
//! By Voronoi regions (Ericson, Real-Time Collision Detection, 5.1): only the points that
//! carry the nearest one are kept.

use nalgebra::Vector3;

/// A corner of the difference of two bodies, with the points it is the difference of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) difference: Vector3<f64>,
    pub(super) on_first: Vector3<f64>,
    pub(super) on_second: Vector3<f64>,
}

impl Corner {
    const UNUSED: Self = Self {
        difference: Vector3::new(0.0, 0.0, 0.0),
        on_first: Vector3::new(0.0, 0.0, 0.0),
        on_second: Vector3::new(0.0, 0.0, 0.0),
    };
}

/// Up to four corners and the weights of the nearest point among them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Simplex {
    corners: [Corner; 4],
    weights: [f64; 4],
    count: usize,
}

impl Simplex {
    pub(super) const EMPTY: Self = Self { corners: [Corner::UNUSED; 4], weights: [0.0; 4], count: 0 };

    pub(super) fn corners(&self) -> &[Corner] {
        &self.corners[..self.count.min(4)]
    }

    pub(super) fn contains(&self, difference: &Vector3<f64>) -> bool {
        self.corners().iter().any(|corner| corner.difference == *difference)
    }

    /// The nearest points on the two bodies.
    pub(super) fn points(&self) -> [Vector3<f64>; 2] {
        let mut points = [Vector3::zeros(); 2];
        for (corner, weight) in self.corners().iter().zip(self.weights) {
            points[0] += corner.on_first * weight;
            points[1] += corner.on_second * weight;
        }
        points
    }

    /// Adds a corner and keeps those that carry the point nearest to the origin, which is
    /// returned; `None` when the origin lies inside.
    pub(super) fn add(&mut self, corner: Corner) -> Option<Vector3<f64>> {
        let last = self.count.min(3);
        self.corners[last] = corner;
        self.count = last + 1;
        let kept = match self.count {
            1 => Kept { at: corner.difference, weights: [1.0, 0.0, 0.0], places: [0, 0, 0], count: 1 },
            2 => self.segment(0, 1),
            3 => self.triangle(0, 1, 2),
            _ => self.tetrahedron()?,
        };
        let corners = self.corners;
        self.count = kept.count;
        for slot in 0..kept.count {
            self.corners[slot] = corners[kept.places[slot]];
            self.weights[slot] = kept.weights[slot];
        }
        Some(kept.at)
    }

    fn segment(&self, a: usize, b: usize) -> Kept {
        let (p, q) = (self.corners[a].difference, self.corners[b].difference);
        let along = q - p;
        let towards = -p.dot(&along);
        let squared = along.norm_squared();
        if towards <= 0.0 || squared <= 0.0 {
            Kept::point(p, a)
        } else if towards >= squared {
            Kept::point(q, b)
        } else {
            let share = towards / squared;
            Kept { at: p + along * share, weights: [1.0 - share, share, 0.0], places: [a, b, 0], count: 2 }
        }
    }

    fn triangle(&self, a: usize, b: usize, c: usize) -> Kept {
        let [p, q, r] = [a, b, c].map(|corner| self.corners[corner].difference);
        let (pq, pr) = (q - p, r - p);
        let (d1, d2) = (-pq.dot(&p), -pr.dot(&p));
        if d1 <= 0.0 && d2 <= 0.0 {
            return Kept::point(p, a);
        }
        let (d3, d4) = (-pq.dot(&q), -pr.dot(&q));
        if d3 >= 0.0 && d4 <= d3 {
            return Kept::point(q, b);
        }
        let (d5, d6) = (-pq.dot(&r), -pr.dot(&r));
        if d6 >= 0.0 && d5 <= d6 {
            return Kept::point(r, c);
        }
        // Each weight is a triangle's doubled area over the whole's; cross products lose less than differences of products.
        let normal = pq.cross(&pr);
        let (wc, wb, wa) = (normal.dot(&p.cross(&q)), normal.dot(&r.cross(&p)), normal.dot(&q.cross(&r)));
        if wc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return self.segment(a, b);
        }
        if wb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return self.segment(a, c);
        }
        if wa <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
            return self.segment(b, c);
        }
        let squared = normal.norm_squared();
        let whole = wa + wb + wc;
        if whole <= 0.0 || squared <= 0.0 {
            // As good as a segment: the best of its edges.
            return [self.segment(a, b), self.segment(a, c), self.segment(b, c)]
                .into_iter()
                .reduce(Kept::nearer)
                .unwrap_or(Kept::point(p, a));
        }
        let weights = [wa / whole, wb / whole, wc / whole];
        Kept { at: normal * (normal.dot(&p) / squared), weights, places: [a, b, c], count: 3 }
    }

    /// The best of the three faces at the newest corner that the origin is outside of: the fourth
    /// was the nearest before that corner was found.
    fn tetrahedron(&self) -> Option<Kept> {
        let [p, q, r, s] = self.corners.map(|corner| corner.difference);
        let mut best: Option<Kept> = None;
        for ([a, b, opposite], places) in [([p, q, r], [0, 1]), ([q, r, p], [1, 2]), ([r, p, q], [2, 0])] {
            let normal = (b - a).cross(&(s - a));
            let (inner, origin) = (normal.dot(&(opposite - a)), -normal.dot(&a));
            // A flat tetrahedron has no inside.
            if inner * origin <= 0.0 {
                let kept = self.triangle(places[0], places[1], 3);
                best = Some(best.map_or(kept, |other| other.nearer(kept)));
            }
        }
        let base = (q - p).cross(&(r - p));
        if best.is_none() && base.dot(&(s - p)) * -base.dot(&p) <= 0.0 {
            best = Some(self.triangle(0, 1, 2));
        }
        best
    }
}

/// The point of a triangle nearest to the origin and what of the triangle carries it: bit k for corner k.
pub(crate) fn nearest_of_triangle(corners: [Vector3<f64>; 3]) -> (Vector3<f64>, usize) {
    let mut simplex = Simplex::EMPTY;
    for (slot, difference) in simplex.corners.iter_mut().zip(corners) {
        slot.difference = difference;
    }
    let kept = simplex.triangle(0, 1, 2);
    (kept.at, kept.places[..kept.count].iter().fold(0, |feature, place| feature | 1 << place))
}

/// A nearest point and the corners that carry it.
#[derive(Clone, Copy)]
struct Kept {
    at: Vector3<f64>,
    weights: [f64; 3],
    places: [usize; 3],
    count: usize,
}

impl Kept {
    fn point(at: Vector3<f64>, place: usize) -> Self {
        Self { at, weights: [1.0, 0.0, 0.0], places: [place, 0, 0], count: 1 }
    }

    fn nearer(self, other: Self) -> Self {
        if other.at.norm_squared() < self.at.norm_squared() { other } else { self }
    }
}
