"""`python -m stages.report`: reports/index.html, one page with everything about the paper."""

import sys
from pathlib import Path

from mimo.record import artifact
from mimo.settings import params
from stages.base import console, paths
from stages.page import page
from stages.page.constants import constants

LOCK = Path("requirements.lock")


def main() -> None:
    """Write the page."""
    p = params.load()
    versions = page.versions(LOCK.read_text(encoding="utf-8"))
    readings = page.prose(paths.READINGS.read_text(encoding="utf-8"))
    own = constants(paths.PARAMS.read_text(encoding="utf-8"))
    html = page.index(page.gathered(p), p.protocol, own, readings, versions)
    artifact.publish(html.encode(), paths.REPORT)


if __name__ == "__main__":
    sys.exit(console.main(main))
