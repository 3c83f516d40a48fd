"""Figures of the paper that are no curves: what they show is what happened, and what params, scene and network hold."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from mimo.learning.rewards import REWARDS
from mimo.record import artifact
from mimo.science import summary
from mimo.settings import params
from mimo.vision import collect, extractor
from mimo.world import body, scene
from stages.drawing import camera, example, schematics, style, taxonomy

REGIME = collect.REGIMES.index((example.CONDITION, example.ROPE))


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for ax in figure.axes for text in ax.texts]


def with_changes(p: params.Params, **sections: dict[str, object]) -> params.Params:
    return p.model_copy(update={name: params.checked(getattr(p, name), own) for name, own in sections.items()})


@pytest.fixture(scope="module")
def held(encoder_file: bytes, tmp_path_factory: pytest.TempPathFactory) -> artifact.Artifact:
    path = tmp_path_factory.mktemp("example") / "encoder.h5"
    path.write_bytes(encoder_file)
    return artifact.read(path, extractor.SCHEMA)


@pytest.fixture(scope="module")
def shown(tiny: params.Params, collected: tuple[np.ndarray, np.ndarray], held: artifact.Artifact) -> example.Example:
    return example.take(tiny, held, collected[0], scene.build(tiny.world, tiny.protocol))


def test_every_reward_of_the_paper_has_a_colour_of_its_own(tiny: params.Params):
    published = params.load().sweep.rewards
    colours = [style.COLOURS[reward] for reward in published]
    assert len({*colours, style.OTHER_COLOUR}) == len(published) + 1


def test_the_example_ends_where_the_recorded_step_ended(
    shown: example.Example, collected: tuple[np.ndarray, np.ndarray], tiny: params.Params
):
    frames, centres = collected
    assert np.array_equal(shown.path[-1], centres[REGIME, 0, shown.step, 1])
    assert np.array_equal(shown.frames, frames[REGIME, 0, [shown.step - 1, shown.step], 1])
    assert len(shown.path) == tiny.protocol.updates_per_step + 1
    assert np.array_equal(shown.path[0], centres[REGIME, 0, shown.step - 1, 1])
    assert shown.learned == frames.shape[2] + shown.step
    assert shown.transition.action[0, body.attached(tiny.protocol.limb)].any()


def test_the_examples_rtl_may_be_of_pictures_on_the_way(
    shown: example.Example, tiny: params.Params, collected: tuple[np.ndarray, np.ndarray], held: artifact.Artifact
):
    four = params.changed(tiny, {"rewards.rtl.frames": 4})
    found = example.take(four, held, collected[0], scene.build(tiny.world, tiny.protocol))
    assert np.array_equal(found.transition.latents[:, [0, -1]], shown.transition.latents)
    way = np.linalg.norm(np.diff(found.transition.latents[0], axis=0), axis=1)
    assert way.shape == (4,)
    assert (way > 0).all()
    assert found.rewards["rtl"] == pytest.approx(way.sum(), rel=1e-5)
    for name in ("mtl", "cais", "surprise"):
        assert np.array_equal(found.rewards[name], shown.rewards[name])


def test_the_examples_rewards_are_what_its_path_latents_and_tables_give(shown: example.Example):
    assert shown.rewards["mtl"] == pytest.approx(np.linalg.norm(np.diff(shown.path, axis=0), axis=1).sum())
    before, after = (h[0] for h in (shown.transition.latent_before, shown.transition.latent))
    assert shown.rewards["rtl"] == pytest.approx(np.linalg.norm(after - before), rel=1e-5)
    moved = shown.transition.action[0]
    distances = np.abs(shown.conditional[:, 1] - shown.marginal).mean(axis=(1, 2))
    assert shown.rewards["cais"] == pytest.approx(np.where(moved, distances, 0), abs=1e-6)
    chosen = shown.conditional[np.arange(len(moved)), moved.astype(int)]
    assert shown.rewards["surprise"] == pytest.approx(np.linalg.norm(after - chosen.mean(axis=2), axis=1), rel=1e-4)


def test_figure_2_says_the_examples_numbers(shown: example.Example, tiny: params.Params):
    said = texts(taxonomy.rewards(tiny, shown))
    joint = shown.rewards["cais"].argmax()
    ends = [text.partition("\n= ")[2] for text in said if "\n= " in text]
    assert ends == [
        f"{1000 * shown.rewards['mtl'][0]:.0f} mm, for all joints",
        f"{shown.rewards['rtl'][0]:.3g}, for all joints",
        f"{shown.rewards['cais'][joint]:.3g}, for {body.ACTUATED[joint]}",
        f"{shown.rewards['surprise'][joint]:.3g}, for {body.ACTUATED[joint]}",
    ]


def test_the_numbers_of_figure_1_follow_params_and_scene(tiny: params.Params, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(camera, "STILL", 32)
    p = with_changes(
        tiny,
        protocol={"limb": "right_hand", "attached_steps": 1000, "updates_per_step": 60, "torque_updates": 25},
        conditions={"noisy": {"force": 17.0}},
        encoder={"latent": 48},
        agent={"gamma": 0.25},
    )
    built = scene.build(p.world, p.protocol)
    built.model.actuator_ctrlrange[0] = (-1.25, 7.5)
    figure = schematics.setting(p, built, np.zeros((128, 128, 3), np.uint8))
    said = "\n".join(texts(figure)).splitlines()
    for text in ("attached", "4–1003", "5 min", "25 updates", "125 ms", "35 updates", "a step: 60 updates, 300 ms",
                 "rope from the right hand to the mobile", "$h_t$ (48)", "$s_t$ (47)", "−1.25", "+7.50"):  # fmt: skip
        assert text in said, text
    assert any("17 N (noisy)" in text for text in said)
    assert any("= 0.25)" in text for text in said)
    paid = {"MTL", "RTL", "CAIS", "Surprise"}
    known = {summary.label(reward) for reward in REWARDS}
    assert paid < known
    assert known & set(said) == paid
    bold = {text.get_text() for text in figure.axes[0].texts if text.get_fontweight() == "bold"}
    assert bold & set(body.ACTUATED) == set(body.LIMB_JOINTS["right_hand"])


def test_the_layers_of_figure_5_follow_params(tiny: params.Params):
    p = with_changes(tiny, encoder={"latent": 48}, agent={"hidden": 32, "move_bias": -0.5, "temperature": 0.7})
    said = texts(schematics.network(p))
    assert [text.replace("\n", " ") for text in said if text.startswith(("Linear", "LayerNorm", "Residual\n"))] == [
        "Linear 95 → 32", "LayerNorm 32", "Residual 32", "Residual 32", "LayerNorm 32", "Linear 32 → 24",
        "Linear 32 → 32", "LayerNorm 32",
    ]  # fmt: skip
    assert "Q(MOVE) − 0.5" in said
    assert any(text.endswith("temperature 0.7") for text in said)
