"""`python -m stages.commands.register` (`make register`): reports/registered.json, what is decided before the runs.

It has the root seed and digests of params.yaml, of the claims and their judgement, and of docs/readings.md. Committed
after these, alone, and before `make paper` computes the first run, it lets the claims stage call its verdicts
confirmatory.
"""

import json
import sys

from mimo.record import artifact
from mimo.settings import params
from stages.base import command, console, paths, registration


def main() -> None:
    """Write what there is to decide, as it is now.

    Raises:
        console.StageError: the root seed served before.
    """
    command.parser("register", __doc__, "make register").parse_args()
    p = params.load()
    if registration.used(p):
        raise console.StageError(
            f"Root seed {p.seed} was registered with something else: set another `seed` in params.yaml."
        )
    text = json.dumps(registration.registered(p), indent=2)
    artifact.publish(f"{text}\n".encode(), paths.REGISTERED)
    print(
        f"{paths.REGISTERED} written. Commit what it has digests of, if that is not done, then\n"
        f"  git add {paths.REGISTERED} && git commit -m 'Registered' {paths.REGISTERED}\nand only then `make paper`."
    )


if __name__ == "__main__":
    sys.exit(console.main(main))
