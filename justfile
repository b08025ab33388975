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

# What `gear new-node` writes compiles, passes its tests and is known. Builds the workspace once more.
new-node:
    cargo test --package gear-tests --test system -- --ignored a_new_node

# The Python package and the nodes that are written with it; needs numpy.
python:
    cd nodes/python && ${GEAR_TEST_PYTHON:-python3} -m unittest discover -s tests -t .

# FluxKontext with the real pipeline class of diffusers, tiny and random, on the CPU. Installs torch (gigabytes) at first.
flux venv="target/flux":
    test -d {{venv}} || (python3 -m venv {{venv}} && {{venv}}/bin/pip install -r nodes/python/flux_kontext/requirements.txt)
    cd nodes/python/flux_kontext && GEAR_TEST_DIFFUSERS=1 PYTHONPATH=.. ../../../{{venv}}/bin/python -m unittest -v test_real_diffusers
    GEAR_TEST_DIFFUSERS_PYTHON={{absolute_path(venv)}}/bin/python cargo test --package gear-tests --test system -- --ignored the_real_pipeline_class

# The reference of nodes and values in the guide, from their definitions.
reference:
    cargo build --bin gear
    cargo run --bin gear -- nodes --markdown > docs/src/reference.md

# The guide, with mdBook.
book: reference
    mdbook build docs

# Look at changed snapshots and accept them.
review:
    cargo insta review
