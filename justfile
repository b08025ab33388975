# What one does daily. `just --list` shows this.

# Format, lints, documentation.
check:
    cargo fmt --all --check
    cargo clippy --workspace --all-targets --locked -- -D warnings
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked

# All tests.
test:
    cargo test --workspace --locked

# The main job on a sample.
run sample="court-lady":
    cargo run --release --locked --bin gear -- run @gear --input painting=sample:{{sample}} --out out

# Work–precision and speed figures.
bench:
    cargo bench --workspace

# The guide, with mdBook.
book:
    mdbook build docs

# Look at changed snapshots and accept them.
review:
    cargo insta review
