//! Loops over plain arrays, compiled for the widest vectors that may be used.

/// A loop for [`wide`]. Mark `run` with `#[inline(always)]`: only what is compiled into the caller is
/// compiled for its vectors.
pub(crate) trait Wide {
    type Output;
    fn run(self) -> Self::Output;
}

/// Runs a loop with AVX2 where the processor has it. The compiler makes vector code of both, and as
/// neither fuses or reorders, the answers are the same to the last bit.
#[inline]
pub(crate) fn wide<W: Wide>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn with_avx2<W: Wide>(work: W) -> W::Output {
            work.run()
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            #[allow(unsafe_code, reason = "the call of a function that needs a feature of the processor")]
            // SAFETY: the one thing that is asked of the caller, that the processor has AVX2, was just found true.
            return unsafe { with_avx2(work) };
        }
    }
    work.run()
}
