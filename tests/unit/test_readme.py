"""The README's table of claims says what reports/claims.json says."""

import json
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_table_of_claims_has_the_published_verdicts() -> None:
    published = json.loads((ROOT / "reports/claims.json").read_text())["claims"]
    rows = re.findall(
        r"^\| (\d\w?) [^|]*\|[^|]*\| \*\*(\w+)\*\* \((\d+)/(\d+)\) \|", (ROOT / "README.md").read_text(), re.M
    )
    assert rows == [
        (
            claim["name"].split()[0],
            claim["verdict"],
            str(sum(test["verdict"] == "holds" for test in claim["tests"])),
            str(len(claim["tests"])),
        )
        for claim in published
    ]
