//! ruckig's C++ as a C++ program uses it: joints known at compile time, nothing copied per call.

use std::ffi::c_void;

macro_rules! functions {
    ($($joints:literal: $new:ident, $delete:ident, $input:ident, $input_delete:ident, $calculate:ident, $duration:ident, $at:ident;)*) => {
        unsafe extern "C" {
            $(
                fn $new() -> *mut c_void;
                fn $delete(solver: *mut c_void);
                fn $input(numbers: *const f64, velocity: bool) -> *mut c_void;
                fn $input_delete(input: *mut c_void);
                fn $calculate(solver: *mut c_void, input: *const c_void) -> i32;
                fn $duration(solver: *const c_void) -> f64;
                fn $at(solver: *mut c_void, time: f64) -> *const f64;
            )*
        }
        /// The C++ functions for one number of joints.
        fn functions(joints: usize) -> Functions {
            match joints {
                $($joints => Functions {
                    new: $new, delete: $delete, input: $input, input_delete: $input_delete,
                    calculate: $calculate, duration: $duration, at: $at,
                },)*
                _ => panic!("{joints} joints are not compiled"),
            }
        }
    };
}

functions! {
    1: ruckig_new_1, ruckig_delete_1, ruckig_input_1, ruckig_input_delete_1, ruckig_calculate_1, ruckig_duration_1, ruckig_at_1;
    3: ruckig_new_3, ruckig_delete_3, ruckig_input_3, ruckig_input_delete_3, ruckig_calculate_3, ruckig_duration_3, ruckig_at_3;
    6: ruckig_new_6, ruckig_delete_6, ruckig_input_6, ruckig_input_delete_6, ruckig_calculate_6, ruckig_duration_6, ruckig_at_6;
    7: ruckig_new_7, ruckig_delete_7, ruckig_input_7, ruckig_input_delete_7, ruckig_calculate_7, ruckig_duration_7, ruckig_at_7;
}

#[derive(Clone, Copy)]
struct Functions {
    new: unsafe extern "C" fn() -> *mut c_void,
    delete: unsafe extern "C" fn(*mut c_void),
    input: unsafe extern "C" fn(*const f64, bool) -> *mut c_void,
    input_delete: unsafe extern "C" fn(*mut c_void),
    calculate: unsafe extern "C" fn(*mut c_void, *const c_void) -> i32,
    duration: unsafe extern "C" fn(*const c_void) -> f64,
    at: unsafe extern "C" fn(*mut c_void, f64) -> *const f64,
}

/// An input, set once.
pub struct Input {
    functions: Functions,
    pointer: *mut c_void,
}

impl Input {
    /// `numbers`: position, velocity and acceleration at start and target, then their limits.
    pub fn new<const N: usize>(numbers: &[[f64; 9]; N], velocity: bool) -> Self {
        let functions = functions(N);
        // SAFETY: the function reads 9 N numbers, which is what the array holds.
        let pointer = unsafe { (functions.input)(numbers.as_ptr().cast(), velocity) };
        Input { functions, pointer }
    }
}

impl Drop for Input {
    fn drop(&mut self) {
        // SAFETY: made by the matching constructor, and deleted once.
        unsafe { (self.functions.input_delete)(self.pointer) }
    }
}

/// A solver and its last trajectory.
pub struct Solver {
    functions: Functions,
    pointer: *mut c_void,
}

impl Solver {
    pub fn new(joints: usize) -> Self {
        let functions = functions(joints);
        // SAFETY: takes nothing.
        Solver { functions, pointer: unsafe { (functions.new)() } }
    }

    /// 0 if there is a trajectory.
    #[inline]
    pub fn calculate(&mut self, input: &Input) -> i32 {
        // SAFETY: both were made for as many joints: the caller has made them so.
        unsafe { (self.functions.calculate)(self.pointer, input.pointer) }
    }

    pub fn duration(&self) -> f64 {
        // SAFETY: the solver lives.
        unsafe { (self.functions.duration)(self.pointer) }
    }

    /// Where the positions, and behind them velocities and accelerations, at `time` stand now.
    #[inline]
    pub fn at(&mut self, time: f64) -> *const f64 {
        // SAFETY: the solver lives.
        unsafe { (self.functions.at)(self.pointer, time) }
    }
}

impl Drop for Solver {
    fn drop(&mut self) {
        // SAFETY: made by the matching constructor, and deleted once.
        unsafe { (self.functions.delete)(self.pointer) }
    }
}
