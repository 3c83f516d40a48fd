"""`python -m stages.commands.studies [STUDY]` (`make studies`): the second pipeline, studies/dvc.yaml, or one of it.

It starts from the paper's encoder, scales, runs and verdicts, and changes none of them.
"""

import sys

from mimo.settings import params, studies
from mimo.settings.errors import Fault
from stages import compare
from stages.base import command, dvc, paths
from stages.commands.paper import reproduce, run

PIPELINE = "studies/dvc.yaml"


def main() -> int:
    """Reproduce the studies, then compare; or one, and the page."""
    parser = command.parser(
        "studies", __doc__, "make studies", "make studies STUDY=noise", "MIMO_WORKERS=4 make studies"
    )
    parser.add_argument("study", nargs="?", help=f"of {studies.PATH}, and the page; default: all")
    asked = parser.parse_args().study
    try:
        p = params.load()
        for name in [asked] if asked else studies.load(p).studies:
            compare.check(name, studies.study(p, name))
    except Fault as fault:
        print(fault, file=sys.stderr)
        return 1
    if dvc.run(["status", "--quiet", "--with-deps", "claims"]):
        print(
            "The paper's results do not fit the code and params.yaml here (`dvc status --with-deps claims` says "
            "where); run `make paper` first.",
            file=sys.stderr,
        )
        return 1
    if asked:  # catalogue and page hang on all studies, and show the others as they are
        last = [f"{PIPELINE}:{stage}" for stage in ("catalogue", "page")]
        own = [f"{PIPELINE}:{stage}" for stage in ("effects", f"compare@{asked}")]
        return run(["repro", *own]) or run(["repro", "--single-item", *last])
    made = ["studies/dvc.lock", "reports/studies", str(paths.STUDIES)]
    return reproduce(["repro", PIPELINE], paths.STUDIES_ARTIFACTS, made)


if __name__ == "__main__":
    sys.exit(main())
