//! Helical threads of the metric profile (60° flanks, flattened crest and root).

/// Right-handed thread on a cylinder about z.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thread {
    /// Advance a turn, metres.
    pitch: f32,
    /// Radius of root (external) or crest (internal), metres.
    inner_radius: f32,
    /// Radial height of the profile, metres.
    height: f32,
}

/// Radial height of an ISO 68-1 external thread over its pitch.
const EXTERNAL_HEIGHT: f32 = 0.6134;
/// The same of an internal thread.
const INTERNAL_HEIGHT: f32 = 0.5413;
/// The radial gap times this is a lower bound of the distance: the flanks fall by
/// 1.25 × 2 × 0.6134 over one pitch, a slope of 1.53, and the helix adds little.
const SLOPE: f32 = 0.52;

impl Thread {
    pub(crate) fn external(major_radius: f32, pitch: f32) -> Self {
        let height = EXTERNAL_HEIGHT * pitch;
        Self { pitch, inner_radius: major_radius - height, height }
    }

    pub(crate) fn internal(major_radius: f32, pitch: f32) -> Self {
        let height = INTERNAL_HEIGHT * pitch;
        Self { pitch, inner_radius: major_radius - height, height }
    }

    /// Radius of the profile where the helix passes at height `z` and direction (x, y).
    #[inline]
    fn radius(&self, x: f32, y: f32, z: f32) -> f32 {
        let turns = z / self.pitch - y.atan2(x) * (0.5 / core::f32::consts::PI);
        let phase = turns - turns.floor();
        let wave = 1.0 - (2.0 * phase - 1.0).abs();
        self.inner_radius + self.height * (1.25 * wave - 0.125).clamp(0.0, 1.0)
    }

    /// Signed distance bound to a threaded rod of unlimited length; `rho` is hypot(x, y).
    #[inline]
    pub(crate) fn rod(&self, x: f32, y: f32, z: f32, rho: f32) -> f32 {
        let outside = rho - self.inner_radius - self.height;
        if outside > self.pitch || rho < self.inner_radius - self.pitch {
            return outside;
        }
        let gap = (rho - self.radius(x, y, z)) * SLOPE;
        // Of two lower bounds the larger, on the side of the air.
        gap.max(outside)
    }

    /// Signed distance bound to the air of a tapped bore: negative in the bore.
    #[inline]
    pub(crate) fn bore(&self, x: f32, y: f32, z: f32, rho: f32) -> f32 {
        let inside = rho - self.inner_radius;
        if inside < -self.pitch || inside > self.height + self.pitch {
            return inside;
        }
        ((rho - self.radius(x, y, z)) * SLOPE).min(inside)
    }
}
