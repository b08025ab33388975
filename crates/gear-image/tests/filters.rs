//! Filters agree with the method's prototypes.

use gear_image::testing::{Oracle, sample_field, sample_painting};
use gear_image::{colour, edges, filter};

fn oracle() -> Oracle {
    Oracle::parse(include_str!("filters.json"))
}

#[test]
fn gaussian_is_the_prototype_s() {
    oracle().check("gaussian_1.7", filter::gaussian(&sample_field(), 1.7).data());
    oracle().check("gaussian_9", filter::gaussian(&sample_field(), 9.0).data());
}

#[test]
fn box_mean_is_the_prototype_s() {
    oracle().check("box_mean_6", filter::box_mean(&sample_field(), 6).data());
    oracle().check("box_mean_50", filter::box_mean(&sample_field(), 50).data());
}

#[test]
fn soft_edges_and_luminance_are_the_prototype_s() {
    let light = colour::light(&sample_painting().rgb);
    oracle().check("luminance", light.luminance().data());
    oracle().check("soft_edges", edges::soft_edges(&light, 1.0, 0.98).data());
}

#[test]
fn filters_give_the_same_bits_on_any_thread_count() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a thread pool");
        pool.install(|| {
            let light = colour::light(&sample_painting().rgb);
            let f = sample_field();
            (
                filter::gaussian(&f, 2.0),
                filter::gaussian(&f, 30.0),
                filter::box_mean(&f, 9),
                filter::resize(&f, 40, 55),
                filter::gaussian_rgb(&light, 3.0),
                edges::soft_edges(&light, 1.0, 0.98),
                light.to_srgb(),
            )
        })
    };
    let one = on(1);
    assert!(one == on(2) && one == on(5));
}
