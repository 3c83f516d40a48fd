"""`python -m stages.studies`: reports/studies.html, one page with everything beyond the paper."""

import sys

from mimo.record import artifact
from mimo.settings import params, studies
from stages.base import console, paths
from stages.page import page
from stages.page.constants import constants


def main() -> None:
    """Write the page, of the studies that are computed."""
    beyond = studies.load(params.load())
    html = page.studies(
        beyond,
        page.gathered_studies(list(beyond.studies)),
        page.read(paths.CLAIMS),
        page.read(paths.EFFECTS),
        constants(studies.PATH.read_text(encoding="utf-8")),
    )
    artifact.publish(html.encode(), paths.STUDIES)


if __name__ == "__main__":
    sys.exit(console.main(main))
