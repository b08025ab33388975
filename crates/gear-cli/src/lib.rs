//! The binary gear: arguments, progress, exit codes
