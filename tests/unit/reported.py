"""A small project with fabricated runs whose outcome is known, and what the stages after them made of it."""

import json
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from mimo.record import artifact
from mimo.record.artifact import Dataset
from mimo.settings import params, studies
from mimo.vision import extractor
from mimo.world import body
from stages import analyse, claims, compare, explore, figures, report
from stages import studies as beyond
from stages.base import numbers, paths, store

ROOT = Path(__file__).resolve().parents[2]
SEEDS = 2
LENGTHS = {"baseline_steps": 20, "attached_steps": 40, "extinction_steps": 20}
STEPS = sum(LENGTHS.values())
MEASURES = {f"r2_{condition}_{axis}": 0.987654321 for condition in ("free", "noisy") for axis in "xyz"} | {"cltt": 0.2}
STUDIES: dict[str, dict[str, Any]] = {
    "constants": {
        "title": "Constants",
        "asks": "Which constant decides?",
        "expects": "None does.",
        "limits": "One at a time.",
        "seeds": SEEDS,
        "measures": ["lead", "burst", "locked"],
        "cells": {"free": ["mtl"]},
        "variants": {
            "gain_1": {"asks": "does it?", "set": {"rewards.gain": 1.0}},
            "heavy": {"asks": "does mass?", "set": {"world.mobile_mass": 0.3}, "cells": {"noisy": ["mtl"]}},
        },
    },
    "noise": {
        "title": "Noise",
        "asks": "How much is too much?",
        "expects": "Little.",
        "limits": "Two doses.",
        "seeds": SEEDS,
        "measures": ["lead"],
        "axis": "conditions.noisy.force",
        "cells": {"noisy": ["cais"]},
        "variants": {f"n{force:.0f}": {"set": {"conditions.noisy.force": force}} for force in (10.0, 20.0)},
    },
}
SIZES = {"attached": [0.8, -0.004, 0.25], "others": 0.05}
JOINTS = {"mtl": SIZES, "rtl": SIZES, "latent": {"attached": [0.03, 0.02, 0.04], "others": 0.01, "ratio": 3.0}}
EFFECTS = {
    "steps": 100,
    "worlds": {
        "published": {"set": {}, "free": JOINTS, "noisy": JOINTS, "phases": {"mtl": 0.14, "rtl": -0.05}},
        "heavy": {
            "set": {"world.mobile_mass": 0.3}, "free": JOINTS, "noisy": JOINTS, "phases": {"mtl": 0.2, "rtl": 0.0},
        },
    },
}  # fmt: skip


def make(tiny: params.Params, frames: np.ndarray, trained: extractor.Trained) -> None:
    """Fill the working directory: settings, runs, encoder, and what the stages made of them.

    Args:
        tiny: for the frames' number and the encoder's shape.
        frames: as mimo.vision.collect gives them.
        trained: an encoder of that shape.
    """
    settings = yaml.safe_load((ROOT / "params.yaml").read_text())
    settings["protocol"] |= LENGTHS
    settings["sweep"]["seeds"] = SEEDS
    settings |= {"collect": tiny.collect.model_dump(), "encoder": tiny.encoder.model_dump(mode="json")}
    paths.PARAMS.write_text(yaml.safe_dump(settings))
    asked = yaml.safe_load((ROOT / studies.PATH).read_text())
    asked["studies"] = STUDIES
    studies.PATH.parent.mkdir()
    studies.PATH.write_text(yaml.safe_dump(asked))
    shutil.copy(ROOT / report.LOCK, report.LOCK)
    paths.READINGS.parent.mkdir()
    shutil.copy(ROOT / paths.READINGS, paths.READINGS)
    for condition in settings["sweep"]["conditions"]:
        for reward in settings["sweep"]["rewards"]:
            for seed in range(SEEDS):
                fabricate(condition, reward, seed)
            list_runs([(condition, reward)], paths.manifest(condition, reward))
    found = studies.Studies.model_validate(asked).studies
    for name, study in found.items():
        for variant in study.variants:
            own = f"{name}/{variant}"
            for condition, reward in study.pairs(variant):
                shutil.copytree(paths.RUNS / condition / reward, paths.VARIANTS / own / condition / reward)
            list_runs(study.pairs(variant), paths.variant_manifest(own), own)
    extractor.save(trained, paths.ENCODER, "trained by a test", MEASURES)
    held = {"frames": Dataset(frames, "1", "regime, world, step, frame, row, column, colour")}
    artifact.write(paths.FRAMES, store.FRAME, "collected by a test", held)
    scale = {"mtl": Dataset(np.array(0.008), "m", "")}
    artifact.write(paths.SCALES, store.SCALE, "fabricated by a test", scale)
    numbers.write(EFFECTS, paths.EFFECTS)
    for stage in (analyse, explore, claims, figures, report):
        stage.main()
    for name in found:
        compared(name)
    beyond.main()


def compared(study: str) -> None:
    """Stage compare, of a study."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["compare", study])
        compare.main()


def fabricate(condition: str, reward: str, seed: int) -> None:
    """A run's file: with the rope on, the attached foot moves most if free, the right hand if noisy."""
    p = np.full((STEPS, 12), 0.25, np.float32)
    on = slice(20, 60)
    p[on, body.attached("left_foot")] = (0.75 if condition == "free" else 0.5) + 0.125 * seed
    p[on, body.attached("right_hand")] = 0.25 if condition == "free" else 0.875
    joints = np.random.default_rng(seed).normal(size=(STEPS, 12)).astype(np.float32)
    datasets = {
        "move_probability": Dataset(p, "1", "step, joint"),
        "action": Dataset((joints > 0).astype(np.uint8), "1 moves", "step, joint"),
        "q": Dataset(np.stack([joints, joints + 1], axis=-1), "scaled reward", "step, joint, action"),
        "reward": Dataset(joints, "scaled reward", "step, joint"),
        "path_length": Dataset(joints[:, 0], "m", "step"),
        "latent_length": Dataset(joints[:, 1], "h", "step"),
        "centre_of_mass": Dataset(joints[:, :3], "m", "step, xyz"),
    }
    datasets |= {f"part/{part}": Dataset(joints, "own units", "step, joint") for part in reward.split("_")}
    if "cais" in reward or "surprise" in reward:
        datasets["influence"] = Dataset(joints, "h", "step, joint")
    digest = f"{condition}, {reward}, {seed}: fabricated by a test"
    artifact.write(paths.run(condition, reward, seed), store.RUN, digest, datasets)


def list_runs(cells: Iterable[tuple[str, str]], manifest: Path, variant: str = "") -> None:
    """A manifest, as stages.train and stages.vary write it."""
    runs = [
        {"variant": variant, "condition": condition, "reward": reward, "seed": seed,
         "digest": f"{condition}, {reward}, {seed}: fabricated by a test"}
        for condition, reward in cells for seed in range(SEEDS)
    ]  # fmt: skip
    manifest.parent.mkdir(parents=True, exist_ok=True)
    manifest.write_text(json.dumps(runs), encoding="utf-8")
