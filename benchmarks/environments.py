"""`python -m benchmarks.environments`: agent steps a second of many worlds, by our vector environment and Gymnasium's.

In turns, three times each, with the same random actions.
"""

import argparse
import time

import gymnasium
import numpy as np
from rich.console import Console
from rich.table import Table

import mimo.world.env  # noqa: F401  # registers it

MODES = {"MIMoMobileVectorEnv": None, "AsyncVectorEnv": "async", "SyncVectorEnv": "sync"}
ROUNDS = 3
WARM = 3  # steps before the clock


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=int, nargs="+", default=[4, 16], help="worlds")
    parser.add_argument("--steps", type=int, default=30, help="agent steps that are timed, each")
    options = parser.parse_args()
    table = Table("worlds", *MODES, title="agent steps a second, median of three rounds (lowest, highest)")
    for envs in options.envs:
        rates: dict[str, list[float]] = {name: [] for name in MODES}
        for _ in range(ROUNDS):
            for name, mode in MODES.items():
                rates[name].append(rate(envs, mode, options.steps))
        table.add_row(str(envs), *(f"{np.median(r):.0f} ({min(r):.0f}, {max(r):.0f})" for r in rates.values()))
    Console(width=120).print(table)


def rate(worlds: int, mode: str | None, steps: int) -> float:
    """Agent steps a second, all worlds together."""
    envs = gymnasium.make_vec("mimo.world.env:mimo/MIMoMobile-v0", num_envs=worlds, vectorization_mode=mode)
    actions = np.random.default_rng(0).integers(0, 2, (WARM + steps, worlds, 12))
    envs.reset(seed=0)
    for action in actions[:WARM]:
        envs.step(action)
    began = time.perf_counter()
    for action in actions[WARM:]:
        envs.step(action)
    taken = time.perf_counter() - began
    envs.close()
    return worlds * steps / taken


if __name__ == "__main__":
    main()
