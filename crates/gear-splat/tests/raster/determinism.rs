//! The same bits on any number of threads.

use gear_splat::cpu::Frame;
use gear_splat::render::{PixelGradients, Wanted};
use gear_splat::{Outputs, RenderOptions};

use crate::scenes::{Random, cameras, cloud};

#[test]
fn pictures_and_gradients_have_the_same_bits_on_any_number_of_threads() {
    let scene = cloud(20_000, 9, 0.002, 0.03, 1);
    let mut random = Random(3);
    for camera in cameras(150, 130) {
        let pixels = PixelGradients {
            rgb: (0..150 * 130).map(|_| [random.within(-1.0, 1.0); 3]).collect(),
            alpha: (0..150 * 130).map(|_| random.within(-1.0, 1.0)).collect(),
        };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let frame = Frame::new(&scene, &camera, &RenderOptions::default(), Outputs::RGBA);
                let picture = frame.draw();
                let gradients = frame.backward(&scene, &picture, &pixels, Wanted::All);
                (picture, gradients)
            })
        };
        let one = run(1);
        assert!(one == run(2) && one == run(7));
    }
}
