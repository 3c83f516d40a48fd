"""`python -m stages.commands.studies` (`make studies`): the second pipeline, studies/dvc.yaml, likewise.

It starts from the paper's encoder, scales and verdicts, and changes none of them.
"""

import sys

from stages.base import command, dvc, paths
from stages.commands.paper import reproduce


def main() -> int:
    """Reproduce the studies, then compare."""
    command.parser("studies", __doc__, "make studies", "MIMO_WORKERS=4 make studies").parse_args()
    if dvc.run(["status", "--quiet", "dvc.yaml"]):
        print(
            "The paper's results do not fit the code and params.yaml here (`dvc status dvc.yaml` says where); "
            "run `make paper` first.",
            file=sys.stderr,
        )
        return 1
    made = ["studies/dvc.lock", "reports/studies", str(paths.STUDIES)]
    return reproduce(["repro", "studies/dvc.yaml"], paths.STUDIES_ARTIFACTS, made)


if __name__ == "__main__":
    sys.exit(main())
