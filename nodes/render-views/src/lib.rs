//! The node render-views
