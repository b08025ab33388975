//! The promises of the whole system, one a module.
