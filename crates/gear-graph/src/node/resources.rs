//! What a run lends to its nodes besides inputs.

use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// What a run lends to its nodes besides inputs, such as a device or a connection: one value of each type.
///
/// A resource must not change results, or the node says so in its [`crate::Node::realm`].
#[derive(Clone, Default)]
pub struct Resources(Vec<Arc<dyn Any + Send + Sync>>);

impl Resources {
    /// These, and `resource`, in place of another of its type.
    pub fn with<T: Any + Send + Sync>(mut self, resource: T) -> Self {
        self.0.retain(|kept| !kept.is::<T>());
        self.0.push(Arc::new(resource));
        self
    }

    /// The resource of this type.
    pub fn get<T: Any>(&self) -> Option<&T> {
        self.0.iter().find_map(|resource| resource.downcast_ref())
    }
}

impl fmt::Debug for Resources {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Resources({})", self.0.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_value_of_each_type() {
        let resources = Resources::default().with(1u8).with("lamp").with(2u8);
        assert_eq!(
            (resources.get::<u8>(), resources.get::<&str>()),
            (Some(&2), Some(&"lamp"))
        );
        assert_eq!(resources.get::<u16>(), None);
    }
}
