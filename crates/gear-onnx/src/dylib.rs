//! The one place that looks into a foreign library itself: its version, before `ort` uses it.
//!
//! `ort` asserts where a library has the right symbol and no usable interface, so that is asked here first, and is an
//! error. The library stays loaded: `ort` opens the same file again and gets the same handle.
#![allow(
    unsafe_code,
    reason = "a library is loaded at run time and asked for its version, so that one that `ort` would stop at is an error"
)]

use std::ffi::{CStr, c_char, c_void};
use std::path::Path;

/// The interface that every release since 1.17 provides: the lowest that `ort` takes.
const INTERFACE: u32 = ort::MINOR_VERSION;

/// The entry of the C interface, as its header declares it (onnxruntime_c_api.h, `OrtApiBase`).
#[repr(C)]
struct ApiBase {
    get_api: Option<unsafe extern "system" fn(u32) -> *const c_void>,
    get_version_string: Option<unsafe extern "system" fn() -> *const c_char>,
}

/// What the system's loader says is behind the error.
fn told(error: &libloading::Error) -> String {
    match std::error::Error::source(error) {
        Some(cause) => format!("{error}: {cause}"),
        None => error.to_string(),
    }
}

/// Loads the library and asks for its version, such as `1.22.0`. An error says what was found.
pub(crate) fn version(path: &Path) -> Result<String, String> {
    // SAFETY: loading runs the library's initialisers. The file is one that the user named, on the command line or in
    // the environment, or that the system's loader finds: never one that a graph names.
    let library = unsafe { libloading::Library::new(path) }.map_err(|error| told(&error))?;
    // SAFETY: the symbol has this type in every release of ONNX Runtime, by its header; a library of another kind that
    // exports the name is taken at its word, as by every program that links it.
    let entry = unsafe { library.get::<unsafe extern "system" fn() -> *const ApiBase>(b"OrtGetApiBase\0") }
        .map_err(|_| "it exports no `OrtGetApiBase`, so it is no ONNX Runtime".to_owned())?;
    // SAFETY: the entry takes nothing and gives a pointer to a static table, or null, which is asked for.
    let base = unsafe { entry().as_ref() }.ok_or("its entry gives no interface")?;
    let text = match base.get_version_string {
        // SAFETY: gives a static text that ends in zero, or null, which is asked for.
        Some(get) => unsafe { get() },
        None => std::ptr::null(),
    };
    if text.is_null() {
        return Err("it tells no version".to_owned());
    }
    // SAFETY: not null, static, and ended by zero.
    let version = unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned();
    // SAFETY: takes a number and gives a pointer or null; nothing is read behind it.
    let interface = base.get_api.map(|get| unsafe { get(INTERFACE) });
    if interface.is_none_or(<*const c_void>::is_null) {
        return Err(format!("it is version {version}, expected 1.{INTERFACE} or later"));
    }
    // It is used until the process ends.
    std::mem::forget(library);
    Ok(version)
}
