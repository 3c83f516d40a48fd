"""A run lived through again: its recorded actions in the real world, without policy, rewards and learning."""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from mimo.learning.experience import Perception
from mimo.learning.rewards.reward import length
from mimo.record import streams
from mimo.record.artifact import Artifact, Dataset
from mimo.settings.params import Params
from mimo.vision.extractor import Extractor
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from mimo.world.protocol import phase
from mimo.world.scene import Scene


@dataclass(frozen=True)
class Replay:
    """What came of a run's actions.

    Attributes:
        record: `centre_of_mass`, `path_length`, `latent_length`: what runs record of world and eye, as they do.
        positions: (updates, nq) by step, for those shown: generalised positions in m and rad after each update.
    """

    record: dict[str, Dataset]
    positions: dict[int, np.ndarray]


def tied(p: Params, run: Artifact, step: int) -> bool:
    """Whether the rope held in a step of a run, counted from 0."""
    if "attached" in run.datasets:  # a rope that holds in some steps alone
        return bool(run["attached"][step])
    return phase(p.protocol, step) == "attached"


def replay(
    p: Params,
    run: Artifact,
    scene: Scene,
    eye: Eye,
    extractor: Extractor,
    shown: Collection[int],
    progress: Callable[[int], None] = lambda done: None,
) -> Replay:
    """Repeat a run from its first step to the last that is shown.

    Args:
        p: what the run was made with.
        run: its record.
        scene: as `p` has it.
        eye: of that scene.
        extractor: the run's.
        shown: steps, counted from 0, of which every physics update is kept.
        progress: called with the number of steps done.

    Raises:
        DivergedError: the physics diverged.
        ValueError: the run is a yoked infant's, whose mobile another moves.
    """
    if run.inputs and "donor" in run.inputs:
        raise ValueError("A yoked infant's run cannot be lived through again: its mobile is another's.")
    condition, seed = str(run.about["condition"]), int(run.about["seed"])
    noise = streams.generator(p.seed, condition, seed, "noise")
    worlds = Worlds(scene, p.protocol, getattr(p.conditions, condition).force, [noise])
    perception = Perception(extractor, eye.frames(worlds.qpos))
    found: dict[str, list[np.ndarray]] = {"centre_of_mass": [], "path_length": [], "latent_length": []}
    positions = {}
    for step in range(max(shown) + 1):
        moved, positive = (run[name][step : step + 1].astype(bool) for name in ("action", "positive"))
        # One update at a time gives the same numbers; the run's record is what shows it.
        cuts = range(1, p.protocol.updates_per_step) if step in shown else ()
        lengths, track = [], []
        for outcome in worlds.pieces(moved, positive, tied(p, run, step), cuts):
            lengths.append(outcome.path_length)
            track.append(worlds.qpos[0])
        if step in shown:
            positions[step] = np.stack(track)
        path_length = np.stack(lengths, axis=1).sum(axis=1)
        seen = perception.transition(moved, path_length, eye.frames(worlds.qpos))
        found["centre_of_mass"].append(outcome.centre_of_mass[0])
        found["path_length"].append(path_length[0])
        found["latent_length"].append(length(seen.latent - seen.latent_before)[0])
        progress(step + 1)
    record = {
        name: Dataset(np.array(values, np.float32), run.datasets[name].units, run.datasets[name].axes)
        for name, values in found.items()
    }
    return Replay(record, positions)
