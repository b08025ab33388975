//! A value of any registered type, as the executor carries it.

use std::any::{Any, TypeId};
use std::fmt;
use std::sync::Arc;

use crate::{Digest, Numerics, Summary, Value, ValueError};

/// What the framework must know of a value type: its [`Value`] implementation, as plain functions.
#[derive(Clone, Copy)]
pub struct ValueType {
    /// [`Value::TYPE`].
    pub name: &'static str,
    /// [`Value::DOC`].
    pub doc: &'static str,
    /// [`Value::EXTENSION`].
    pub extension: &'static str,
    /// [`Value::NUMERICS`].
    pub numerics: Numerics,
    type_id: fn() -> TypeId,
    digest: fn(&dyn Any) -> Option<Digest>,
    size_bytes: fn(&dyn Any) -> usize,
    encode: fn(&dyn Any) -> Result<Vec<u8>, ValueError>,
    decode: fn(&[u8]) -> Result<AnyValue, ValueError>,
    summary: fn(&dyn Any) -> Summary,
    flaw: fn(&dyn Any) -> Option<String>,
    extremes: fn() -> Vec<(&'static str, AnyValue)>,
    matched: fn(&dyn Any, &AnyValue) -> Option<AnyValue>,
}

impl ValueType {
    /// The description of `T`.
    pub const fn of<T: Value>() -> Self {
        Self {
            name: T::TYPE,
            doc: T::DOC,
            extension: T::EXTENSION,
            numerics: T::NUMERICS,
            type_id: TypeId::of::<T>,
            digest: |any| any.downcast_ref::<T>().map(Value::digest),
            size_bytes: |any| any.downcast_ref::<T>().map_or(0, Value::size_bytes),
            encode: |any| match any.downcast_ref::<T>() {
                Some(value) => value.encode(),
                None => Err(ValueError::new(T::TYPE, "holds a value of another type")),
            },
            decode: |bytes| T::decode(bytes).map(AnyValue::new),
            summary: |any| any.downcast_ref::<T>().map(Value::summary).unwrap_or_default(),
            flaw: |any| any.downcast_ref::<T>().and_then(Value::flaw),
            extremes: || {
                T::extremes()
                    .into_iter()
                    .map(|(name, value)| (name, AnyValue::new(value)))
                    .collect()
            },
            matched: |any, other| any.downcast_ref::<T>()?.matched(other).map(AnyValue::new),
        }
    }

    /// Decodes what [`AnyValue::encode`] wrote for a value of this type.
    pub fn decode(&self, bytes: &[u8]) -> Result<AnyValue, ValueError> {
        (self.decode)(bytes)
    }

    /// The named extreme cases that the type declares.
    pub fn extremes(&self) -> Vec<(&'static str, AnyValue)> {
        (self.extremes)()
    }

    /// Whether this describes `T`.
    pub fn is<T: Value>(&self) -> bool {
        (self.type_id)() == TypeId::of::<T>()
    }
}

impl PartialEq for ValueType {
    fn eq(&self, other: &Self) -> bool {
        (self.type_id)() == (other.type_id)()
    }
}

impl Eq for ValueType {}

impl serde::Serialize for ValueType {
    /// Its name.
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
    }
}

impl fmt::Debug for ValueType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// A shared value of any registered type.
#[derive(Clone)]
pub struct AnyValue {
    value: Arc<dyn Any + Send + Sync>,
    /// Shared: a description is larger than most values.
    value_type: &'static ValueType,
}

/// Where the description of a type stands.
struct Described<T>(std::marker::PhantomData<T>);

impl<T: Value> Described<T> {
    const TYPE: ValueType = ValueType::of::<T>();
}

impl AnyValue {
    /// Wraps a value.
    pub fn new<T: Value>(value: T) -> Self {
        Self::shared(Arc::new(value))
    }

    /// Wraps a value that is already shared.
    pub fn shared<T: Value>(value: Arc<T>) -> Self {
        Self {
            value,
            value_type: &Described::<T>::TYPE,
        }
    }

    /// The type of the value.
    pub fn value_type(&self) -> ValueType {
        *self.value_type
    }

    /// The value, if it is a `T`.
    pub fn get<T: Value>(&self) -> Option<Arc<T>> {
        Arc::clone(&self.value).downcast().ok()
    }

    /// The value, or an error that says what it is instead.
    pub fn expect<T: Value>(&self) -> Result<Arc<T>, ValueError> {
        self.get()
            .ok_or_else(|| ValueError::new(T::TYPE, format!("expected {}, found {}", T::TYPE, self.value_type.name)))
    }

    /// [`Value::digest`].
    pub fn digest(&self) -> Digest {
        // `value_type` was made for the very type of `value` in `shared`, the only constructor.
        (self.value_type.digest)(&*self.value).expect("the type of its own value")
    }

    /// [`Value::size_bytes`].
    pub fn size_bytes(&self) -> usize {
        (self.value_type.size_bytes)(&*self.value)
    }

    /// [`Value::encode`].
    pub fn encode(&self) -> Result<Vec<u8>, ValueError> {
        (self.value_type.encode)(&*self.value)
    }

    /// [`Value::summary`].
    pub fn summary(&self) -> Summary {
        (self.value_type.summary)(&*self.value)
    }

    /// [`Value::flaw`].
    pub fn flaw(&self) -> Option<String> {
        (self.value_type.flaw)(&*self.value)
    }

    /// [`Value::matched`].
    pub fn matched(&self, other: &Self) -> Option<Self> {
        (self.value_type.matched)(&*self.value, other)
    }
}

impl fmt::Debug for AnyValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}({})",
            self.value_type.name,
            serde_json::Value::Object(self.summary())
        )
    }
}
