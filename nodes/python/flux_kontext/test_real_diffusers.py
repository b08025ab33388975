"""FluxKontext with the real pipeline class of diffusers, its networks tiny and random: opt-in, since it needs torch.

    python -m venv /tmp/flux && /tmp/flux/bin/pip install -r requirements.txt
    GEAR_TEST_DIFFUSERS=1 PYTHONPATH=.. /tmp/flux/bin/python -m unittest -v test_real_diffusers

What it proves: that the node's own code loads a pipeline from a folder as `save_pretrained` writes it, hands pictures, words,
sizes, seed and callback to it as it wants them, and takes what comes out. Not what the pictures look like: the networks have
learnt nothing.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

from gear_sdk import Camera, Cancelled, Context, Image, View, Views

WANTED = os.environ.get("GEAR_TEST_DIFFUSERS") == "1"


def tokenizers(folder: Path):
    """A CLIP tokenizer and a T5 one with vocabularies of letters."""
    from tokenizers import Tokenizer, decoders, models, pre_tokenizers
    from transformers import CLIPTokenizer, PreTrainedTokenizerFast

    letters = [chr(c) for c in range(33, 127)]
    vocabulary = letters + [letter + "</w>" for letter in letters] + ["<|startoftext|>", "<|endoftext|>"]
    (folder / "vocab.json").write_text(json.dumps({word: i for i, word in enumerate(vocabulary)}))
    (folder / "merges.txt").write_text("#version: 0.2\n")
    clip = CLIPTokenizer(str(folder / "vocab.json"), str(folder / "merges.txt"), model_max_length=77)
    pieces = [("<pad>", 0.0), ("</s>", 0.0), ("<unk>", 0.0), ("▁", -2.0)] + [(letter, -3.0) for letter in letters]
    model = Tokenizer(models.Unigram(pieces, unk_id=2))
    model.pre_tokenizer = pre_tokenizers.Metaspace()
    model.decoder = decoders.Metaspace()
    t5 = PreTrainedTokenizerFast(tokenizer_object=model, pad_token="<pad>", eos_token="</s>", unk_token="<unk>")
    return clip, t5, len(vocabulary), len(pieces)


def tiny_pipeline(folder: Path) -> None:
    """Writes a FluxKontextPipeline whose networks are as small as their classes allow."""
    import torch
    from diffusers import AutoencoderKL, FlowMatchEulerDiscreteScheduler, FluxKontextPipeline, FluxTransformer2DModel
    from transformers import CLIPTextConfig, CLIPTextModel, T5Config, T5EncoderModel

    torch.manual_seed(0)
    with tempfile.TemporaryDirectory() as words:
        clip, t5, clip_words, t5_words = tokenizers(Path(words))
    transformer = FluxTransformer2DModel(
        patch_size=1,
        in_channels=16,
        num_layers=1,
        num_single_layers=1,
        attention_head_dim=16,
        num_attention_heads=2,
        joint_attention_dim=32,
        pooled_projection_dim=32,
        guidance_embeds=True,
        axes_dims_rope=[4, 4, 8],
    )
    clip_model = CLIPTextModel(
        CLIPTextConfig(
            vocab_size=clip_words,
            hidden_size=32,
            intermediate_size=37,
            num_hidden_layers=2,
            num_attention_heads=4,
            bos_token_id=clip_words - 2,
            eos_token_id=clip_words - 1,
            projection_dim=32,
        )
    )
    t5_model = T5EncoderModel(
        T5Config(vocab_size=t5_words, d_model=32, d_ff=37, d_kv=8, num_layers=2, num_heads=4, decoder_start_token_id=0)
    )
    vae = AutoencoderKL(
        sample_size=32,
        in_channels=3,
        out_channels=3,
        block_out_channels=(4,),
        layers_per_block=1,
        latent_channels=4,
        norm_num_groups=1,
        use_quant_conv=False,
        use_post_quant_conv=False,
        shift_factor=0.0609,
        scaling_factor=1.5035,
    )
    FluxKontextPipeline(
        scheduler=FlowMatchEulerDiscreteScheduler(),
        text_encoder=clip_model.eval(),
        text_encoder_2=t5_model.eval(),
        tokenizer=clip,
        tokenizer_2=t5,
        transformer=transformer.eval(),
        vae=vae.eval(),
        image_encoder=None,
        feature_extractor=None,
    ).save_pretrained(folder)


@unittest.skipUnless(WANTED, "needs torch and diffusers: set GEAR_TEST_DIFFUSERS=1 to run it")
class RealDiffusers(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        import diffusers
        import torch
        import transformers

        print(f"\ntorch {torch.__version__}, diffusers {diffusers.__version__}, transformers {transformers.__version__}")
        cls.folder = tempfile.TemporaryDirectory()
        tiny_pipeline(Path(cls.folder.name))
        os.environ["FLUX_KONTEXT_WEIGHTS"] = cls.folder.name
        os.environ["FLUX_KONTEXT_DEVICE"] = "cpu"
        sys.path.insert(0, str(Path(__file__).parent))
        import worker

        cls.worker = worker

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def picture(self, width=100, height=70):
        return Image(np.random.default_rng(1).random((height, width, 3), np.float32))

    def edit(self, ctx=None, image=None, **params):
        node = self.worker.FluxKontext
        return node(ctx or Context(), image or self.picture(), **{"steps": 2, "area": 4096, **params})["image"]

    def test_it_is_the_class_of_diffusers(self):
        self.assertEqual(type(self.worker.pipeline()).__module__, "diffusers.pipelines.flux.pipeline_flux_kontext")

    def test_a_picture_comes_back_at_its_size(self):
        told = []
        out = self.edit(Context(on_progress=lambda fraction, message: told.append(fraction)))
        self.assertEqual(out.rgb.shape, (70, 100, 3))
        self.assertTrue(np.isfinite(out.rgb).all() and (out.rgb >= 0).all() and (out.rgb <= 1).all())
        self.assertGreater(out.rgb.std(), 0.0)
        self.assertEqual(told, sorted(told))
        self.assertEqual(told[-1], 1.0)

    def test_the_same_seed_gives_the_same_bits_and_another_others(self):
        first, again, other = self.edit(seed=3), self.edit(seed=3), self.edit(seed=4)
        np.testing.assert_array_equal(first.rgb, again.rgb)
        self.assertGreater(np.abs(first.rgb - other.rgb).max(), 0.0)

    def test_words_and_picture_and_guidance_count(self):
        plain = self.edit(seed=1)
        dark = Image(self.picture().rgb * 0.1)
        for other in (self.edit(seed=1, prompt="a pencil sketch"), self.edit(image=dark, seed=1), self.edit(seed=1, guidance=9.0)):
            self.assertGreater(np.abs(plain.rgb - other.rgb).max(), 0.0)

    def test_every_view_is_edited_and_keeps_its_camera(self):
        views = Views([View(Camera.front(64, 80), name, self.picture(64, 80).rgb, np.full((80, 64), a)) for name, a in (("a", 0.5), ("b", 1.0))])
        out = self.worker.FluxKontextViews(Context(), views, steps=1, area=4096)["targets"]
        self.assertEqual([view.name for view in out.views], ["a", "b"])
        np.testing.assert_array_equal(out.views[0].weight, 0.5)
        self.assertEqual(out.views[1].camera.to_json(), views.views[1].camera.to_json())
        self.assertGreater(np.abs(out.views[0].rgb - views.views[0].rgb).max(), 0.0)

    def test_it_can_be_stopped_between_steps(self):
        import threading

        stop = threading.Event()
        ctx = Context(cancelled=stop, on_progress=lambda fraction, message: stop.set() if fraction > 0.1 else None)
        with self.assertRaises(Cancelled):
            self.edit(ctx, steps=50)


class Sizes(unittest.TestCase):
    def test_the_shape_is_kept_and_sides_are_multiples_of_16(self):
        sys.path.insert(0, str(Path(__file__).parent))
        import worker

        for width, height in ((768, 512), (100, 70), (1, 400), (4000, 10)):
            w, h = worker.size_for(width, height, 1 << 20)
            self.assertEqual((w % 16, h % 16), (0, 0))
            self.assertGreaterEqual(min(w, h), 64)
        self.assertEqual(worker.size_for(1024, 1024, 1 << 20), (1024, 1024))


if __name__ == "__main__":
    unittest.main()
