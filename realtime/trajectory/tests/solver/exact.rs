//! Double-double arithmetic: about 32 digits, from error-free sums and products.

/// An unevaluated sum of two doubles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exact(pub(crate) f64, pub(crate) f64);

fn sum(a: f64, b: f64) -> Exact {
    let s = a + b;
    let z = s - a;
    Exact(s, (a - (s - z)) + (b - z))
}

impl From<f64> for Exact {
    fn from(x: f64) -> Self {
        Exact(x, 0.0)
    }
}

impl std::ops::Add for Exact {
    type Output = Exact;
    fn add(self, other: Exact) -> Exact {
        let (high, low) = (sum(self.0, other.0), sum(self.1, other.1));
        let first = sum(high.0, high.1 + low.0);
        sum(first.0, first.1 + low.1)
    }
}

impl std::ops::Mul for Exact {
    type Output = Exact;
    fn mul(self, other: Exact) -> Exact {
        let product = self.0 * other.0;
        let error = self.0.mul_add(other.0, -product);
        sum(product, error + self.0 * other.1 + self.1 * other.0)
    }
}

impl std::ops::Div<f64> for Exact {
    type Output = Exact;
    fn div(self, by: f64) -> Exact {
        let quotient = self.0 / by;
        let product = quotient * by;
        let error = quotient.mul_add(by, -product);
        sum(quotient, (((self.0 - product) - error) + self.1) / by)
    }
}
