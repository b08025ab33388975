//! Numbers, booleans, texts, lists and options as parameters.

use super::{Bound, Limits, Param, ParamKind, ParamValue, Reader, Tree, TreeKind};

impl Param for bool {
    fn kind() -> ParamKind {
        ParamKind::Bool
    }

    fn read(tree: &Tree, _: &Limits, reader: &mut Reader<'_>) -> Option<Self> {
        match tree.kind {
            TreeKind::Bool(b) => Some(b),
            _ => {
                reader.wrong_kind(tree, "true or false");
                None
            }
        }
    }

    fn write(&self) -> ParamValue {
        (*self).into()
    }
}

impl Param for f64 {
    fn kind() -> ParamKind {
        ParamKind::Number
    }

    fn read(tree: &Tree, limits: &Limits, reader: &mut Reader<'_>) -> Option<Self> {
        let x = match tree.kind {
            TreeKind::Integer(i) => i as f64,
            TreeKind::Float(f) => f,
            _ => {
                reader.wrong_kind(tree, "a number");
                return None;
            }
        };
        if limits.allow(x) {
            // -0 and 0 are the same number and must have the same key.
            Some(x + 0.0)
        } else {
            reader.out_of_range(tree, limits);
            None
        }
    }

    fn write(&self) -> ParamValue {
        ParamValue::from(*self)
    }
}

impl Param for f32 {
    fn kind() -> ParamKind {
        ParamKind::Number
    }

    fn read(tree: &Tree, limits: &Limits, reader: &mut Reader<'_>) -> Option<Self> {
        let x = f64::read(tree, limits, reader)? as f32;
        if x.is_finite() {
            Some(x)
        } else {
            reader.out_of_range(tree, &Limits::none().within(f64::from(f32::MIN)..=f64::from(f32::MAX)));
            None
        }
    }

    fn write(&self) -> ParamValue {
        // The shortest decimal that is this f32, so that 0.1 is shown as 0.1.
        self.to_string()
            .parse::<f64>()
            .map_or(ParamValue::Null, ParamValue::from)
    }
}

macro_rules! integers {
    ($($ty:ty)*) => {$(
        impl Param for $ty {
            fn kind() -> ParamKind {
                ParamKind::Integer
            }

            fn bounds() -> Limits {
                // Beyond 2^53, floats are no longer whole numbers one by one.
                let end = |value: f64| (value.abs() <= 9_007_199_254_740_992.0).then_some(Bound { value, inclusive: true });
                Limits {
                    min: end(<$ty>::MIN as f64),
                    max: end(<$ty>::MAX as f64),
                    unit: None,
                }
            }

            fn read(tree: &Tree, limits: &Limits, reader: &mut Reader<'_>) -> Option<Self> {
                let TreeKind::Integer(i) = tree.kind else {
                    reader.wrong_kind(tree, "a whole number");
                    return None;
                };
                match <$ty>::try_from(i) {
                    Ok(value) if limits.allow(i as f64) => Some(value),
                    _ => {
                        let mut limits = limits.clone();
                        if limits.min.is_none() && limits.max.is_none() {
                            limits = limits.within((<$ty>::MIN as f64)..=(<$ty>::MAX as f64));
                        }
                        reader.out_of_range(tree, &limits);
                        None
                    }
                }
            }

            fn write(&self) -> ParamValue {
                ParamValue::from(*self)
            }
        }
    )*};
}

integers!(u8 u16 u32 u64 usize i32 i64);

impl Param for String {
    fn kind() -> ParamKind {
        ParamKind::Text
    }

    fn read(tree: &Tree, _: &Limits, reader: &mut Reader<'_>) -> Option<Self> {
        match &tree.kind {
            TreeKind::Text(text) => Some(text.clone()),
            _ => {
                reader.wrong_kind(tree, "a text");
                None
            }
        }
    }

    fn write(&self) -> ParamValue {
        self.as_str().into()
    }
}

impl<T: Param> Param for Vec<T> {
    fn kind() -> ParamKind {
        ParamKind::List {
            of: Box::new(T::kind()),
            len: None,
        }
    }

    fn bounds() -> Limits {
        T::bounds()
    }

    fn read(tree: &Tree, limits: &Limits, reader: &mut Reader<'_>) -> Option<Self> {
        let TreeKind::List(items) = &tree.kind else {
            reader.wrong_kind(tree, &Self::kind().describe());
            return None;
        };
        // Every element is read before giving up, so that all mistakes are reported at once.
        let read: Vec<_> = items.iter().map(|item| T::read(item, limits, reader)).collect();
        read.into_iter().collect()
    }

    fn write(&self) -> ParamValue {
        self.iter().map(Param::write).collect()
    }
}

impl<T: Param, const N: usize> Param for [T; N] {
    fn kind() -> ParamKind {
        ParamKind::List {
            of: Box::new(T::kind()),
            len: Some(N),
        }
    }

    fn bounds() -> Limits {
        T::bounds()
    }

    fn read(tree: &Tree, limits: &Limits, reader: &mut Reader<'_>) -> Option<Self> {
        match &tree.kind {
            TreeKind::List(items) if items.len() == N => Vec::read(tree, limits, reader)?.try_into().ok(),
            _ => {
                reader.wrong_kind(tree, &Self::kind().describe());
                None
            }
        }
    }

    fn write(&self) -> ParamValue {
        self.iter().map(Param::write).collect()
    }
}

impl<T: Param> Param for Option<T> {
    fn kind() -> ParamKind {
        ParamKind::Optional {
            of: Box::new(T::kind()),
        }
    }

    fn bounds() -> Limits {
        T::bounds()
    }

    fn read(tree: &Tree, limits: &Limits, reader: &mut Reader<'_>) -> Option<Self> {
        match tree.kind {
            TreeKind::Null => Some(None),
            _ => T::read(tree, limits, reader).map(Some),
        }
    }

    fn write(&self) -> ParamValue {
        self.as_ref().map_or(ParamValue::Null, Param::write)
    }
}

/// The word `auto`, or a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OrAuto<T> {
    /// The node finds the value itself.
    Auto,
    /// This value.
    Value(T),
}

impl<T: Copy> OrAuto<T> {
    /// The value, unless it is `auto`.
    pub fn value(&self) -> Option<T> {
        match self {
            Self::Auto => None,
            Self::Value(value) => Some(*value),
        }
    }
}

impl<T: Param> Param for OrAuto<T> {
    fn kind() -> ParamKind {
        ParamKind::OrAuto {
            of: Box::new(T::kind()),
        }
    }

    fn bounds() -> Limits {
        T::bounds()
    }

    fn read(tree: &Tree, limits: &Limits, reader: &mut Reader<'_>) -> Option<Self> {
        match &tree.kind {
            TreeKind::Text(word) if word == "auto" => Some(Self::Auto),
            TreeKind::Text(_) | TreeKind::Null | TreeKind::Bool(_) | TreeKind::Map(_)
                if matches!(T::kind(), ParamKind::Number | ParamKind::Integer) =>
            {
                reader.wrong_kind(tree, &Self::kind().describe());
                None
            }
            _ => T::read(tree, limits, reader).map(Self::Value),
        }
    }

    fn write(&self) -> ParamValue {
        match self {
            Self::Auto => "auto".into(),
            Self::Value(value) => value.write(),
        }
    }
}
