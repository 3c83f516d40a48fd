"""`python -m stages.commands.register` (`make register`): reports/registered.json, what is decided before the runs.

It has the root seed and digests of params.yaml, of the claims and their judgement, and of docs/readings.md. Committed
alone, before `make paper` computes the first run, it lets the claims stage call its verdicts confirmatory.
"""

import json
import sys

from mimo.record import artifact
from mimo.settings import params
from stages.base import command, console, paths, registration


def main() -> None:
    """Write what there is to decide, as it is now."""
    command.parser("register", __doc__, "make register").parse_args()
    text = json.dumps(registration.registered(params.load()), indent=2)
    artifact.publish(f"{text}\n".encode(), paths.REGISTERED)
    print(f"{paths.REGISTERED} written. Commit it alone, then `make paper`; a root seed serves once.")


if __name__ == "__main__":
    sys.exit(console.main(main))
