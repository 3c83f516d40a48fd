"""A sweep on a real Ray cluster whose two nodes share no files: the same bytes, while nodes come and go."""

import re
import secrets
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.faults import cluster, harness
from tests.faults.cluster import Host
from tests.faults.conftest import Pipeline

pytestmark = pytest.mark.timeout(900)


@pytest.fixture
def hosts(computed: Pipeline, tmp_path: Path) -> Iterator[tuple[Host, Host]]:
    try:
        with cluster.two_hosts(tmp_path, hidden=computed.project) as made:
            yield made
    except PermissionError as fault:
        pytest.skip(f"no namespaces can be made here: {fault}")


def test_nodes_that_come_and_go_cost_no_byte(pipeline: Pipeline, hosts: tuple[Host, Host], tmp_path: Path) -> None:
    """One node begins; a foreign one that joins ends the sweep; it is refused; so is a driver without the token.

    Then one of the same libraries joins, computes and dies.
    """
    first, second = hosts
    shell = cluster.environment(RAY_AUTH_MODE="token", RAY_AUTH_TOKEN=secrets.token_hex(16))
    first.start("--head", f"--port={cluster.PORT}", "--include-dashboard=false", environment=shell)
    where = f"{first.address}:{cluster.PORT}"

    other = tmp_path / "other/numpy-1.0.0.dist-info"
    other.mkdir(parents=True)
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 1.0.0\n")
    sentence = rf"(?m)^The cluster is refused: node \S+ \({second.address}\) has numpy 1\.0\.0 instead of \S+\. Install"
    joined = pipeline.start(workers=False, within=first.within, also=shell | {"RAY_ADDRESS": where})
    joined.until(first.computing)
    with first.held():
        second.start(f"--address={where}", environment=shell | {"PYTHONPATH": str(other.parent)})
        harness.wait(lambda: re.search(sentence, joined.said), lambda: joined.said)
    kept = pipeline.stopped(joined, sentence, {})
    refused = pipeline.start(workers=False, within=first.within, also=shell | {"RAY_ADDRESS": where})
    assert pipeline.stopped(refused, sentence, kept) == kept
    second.fail()

    stranger = pipeline.start(
        workers=False, within=first.within, also=cluster.environment(RAY_AUTH_MODE="disabled", RAY_ADDRESS=where)
    )
    sentence = rf"(?m)^The cluster at RAY_ADDRESS={where} cannot be joined \(.*\)\.$"
    assert pipeline.stopped(stranger, sentence, kept) == kept

    repro = pipeline.start(workers=False, within=first.within, also=shell | {"RAY_ADDRESS": where})
    repro.until(first.computing)
    with first.held():
        second.start(f"--address={where}", environment=shell)
        repro.until(second.computing)
    kept = harness.finished(pipeline.project)
    assert len(kept) < harness.RUNS
    second.fail()
    pipeline.completes(repro, kept)
