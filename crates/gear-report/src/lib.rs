//! What people look at: HTML pages, plots, contact sheets
