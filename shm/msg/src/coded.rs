//! Enumerations that may come from a faulty peer.

use core::fmt;
use core::marker::PhantomData;

/// An enumeration that travels as a number.
pub trait Coded: Copy + Eq + 'static {
    /// Every variant, in the order of their numbers.
    const ALL: &'static [Self];
    /// The number that travels.
    fn code(self) -> u32;
    /// The field's word for the variant, as it stands in files and on the screen.
    fn name(self) -> &'static str;
    /// The variant of that name.
    fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|variant| variant.name() == name)
    }
}

/// A [`Coded`] value as it lies in shared memory: any 32 bits are valid.
#[repr(transparent)]
pub struct Code<T>(u32, PhantomData<fn() -> T>);

impl<T: Coded> Code<T> {
    /// The code of a variant.
    pub fn of(value: T) -> Self {
        Self(value.code(), PhantomData)
    }

    /// The variant, or `None` for a number that no variant has.
    pub fn get(self) -> Option<T> {
        T::ALL.iter().copied().find(|variant| variant.code() == self.0)
    }

    /// Whether this is the code of `value`.
    pub fn is(self, value: T) -> bool {
        self.0 == value.code()
    }

    /// The number as it travelled.
    pub fn raw(self) -> u32 {
        self.0
    }

    /// A code from 32 bits of any origin.
    pub fn from_raw(raw: u32) -> Self {
        Self(raw, PhantomData)
    }
}

impl<T> Clone for Code<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Code<T> {}
impl<T> PartialEq for Code<T> {
    fn eq(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}
impl<T> Eq for Code<T> {}
impl<T: Coded> From<T> for Code<T> {
    fn from(value: T) -> Self {
        Self::of(value)
    }
}
impl<T> Default for Code<T> {
    /// Code 0, which every enumeration here gives to its resting variant.
    fn default() -> Self {
        Self(0, PhantomData)
    }
}
impl<T: Coded> fmt::Debug for Code<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.get() {
            Some(value) => f.write_str(value.name()),
            None => write!(f, "unknown({})", self.0),
        }
    }
}

/// Declares an enumeration with its numbers and its names.
macro_rules! coded {
    ($(#[$meta:meta])* $vis:vis enum $name:ident { $($(#[$vmeta:meta])* $variant:ident = $code:literal, $text:literal;)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u32)]
        $vis enum $name { $($(#[$vmeta])* $variant = $code,)+ }

        impl crate::Coded for $name {
            const ALL: &'static [Self] = &[$(Self::$variant,)+];
            fn code(self) -> u32 { self as u32 }
            fn name(self) -> &'static str { match self { $(Self::$variant => $text,)+ } }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.pad(crate::Coded::name(*self))
            }
        }
    };
}
pub(crate) use coded;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EffectorAction, FeatureClass, MotionFailure, MotionPhase, PlantFault, StopCause, Subtask, Tool};

    fn survives<T: Coded + core::fmt::Debug>() {
        for &value in T::ALL {
            assert_eq!(Code::of(value).get(), Some(value));
            assert_eq!(T::named(value.name()), Some(value));
        }
        assert_eq!(Code::<T>::from_raw(u32::MAX).get(), None);
        assert_eq!(T::ALL[0].code(), 0, "the resting variant has code 0: {:?}", T::ALL[0]);
    }

    /// Numbers and names both identify a variant, and foreign numbers are refused.
    #[test]
    fn codes_and_names_are_unique() {
        survives::<Tool>();
        survives::<EffectorAction>();
        survives::<FeatureClass>();
        survives::<MotionPhase>();
        survives::<MotionFailure>();
        survives::<StopCause>();
        survives::<Subtask>();
        survives::<PlantFault>();
    }
}
