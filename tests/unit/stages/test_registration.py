"""Whether verdicts are confirmatory, in git repositories with the project's own constants, claims and readings."""

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mimo.record import identity
from mimo.settings import params
from stages.base import console, paths, registration
from stages.commands import register

ROOT = Path(__file__).resolve().parents[3]
CLAIMS = Path("mimo/science/claims.py")
SEED = params.load(ROOT / paths.PARAMS).seed
BEFORE, AT, AFTER, LATER = (f"2026-05-0{day}T12:00:00+00:00" for day in (1, 2, 3, 4))
RUNS = ("a" * 64, "b" * 64)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What registration reads, not registered yet, in git; the working directory."""
    (top := tmp_path / "project").mkdir()
    monkeypatch.chdir(top)
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", str(tmp_path / "none"))
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")
    for role in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{role}_NAME", "lab")
        monkeypatch.setenv(f"GIT_{role}_EMAIL", "lab@example.org")
    for path in (paths.PARAMS, paths.READINGS, *registration.CLAIMS):
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, path)
    Path(".gitignore").write_text(".work/\n", encoding="utf-8")
    git("init", "-q")
    commit(BEFORE)
    return top


@pytest.fixture
def registered(project: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Registered and committed AT; the runs were made AFTER."""
    register_now(monkeypatch)
    commit(AT)
    ran(AFTER, RUNS[0])
    ran(LATER, RUNS[1])
    return project


def git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], check=True, capture_output=True, text=True).stdout


def commit(at: str) -> None:
    """All that there is."""
    git("add", "-A")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GIT_COMMITTER_DATE", at)
        git("commit", "-q", "-m", "some")


def register_now(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["register"])
    register.main()


def register_anyhow() -> None:
    """As someone might who would rather not hear of the seed."""
    paths.REGISTERED.write_text(json.dumps(registration.registered(params.load())), encoding="utf-8")


def ran(at: str, digest: str) -> None:
    """A line of the store's, as provenance.note writes it."""
    paths.provenance().parent.mkdir(exist_ok=True)
    with paths.provenance().open("a", encoding="utf-8") as file:
        file.write(f"\n{json.dumps({'schema': 'run', 'digest': digest, 'at': at})}")


def published(first: str) -> None:
    paths.PUBLISHED_ON.write_text(json.dumps({"made": {"run": {"first": first, "last": LATER}}}), encoding="utf-8")


def changed(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")


def standing() -> dict[str, object]:
    return registration.standing(params.load(), RUNS)


def why() -> str:
    """Why they are not confirmatory; empty if they are."""
    found = standing()
    assert found["confirmatory"] == ("why" not in found) == ("at" in found)
    return str(found.get("why", ""))


NOT_IN_GIT = "reports/registered.json is not committed as it is here"
NO_GIT = "git is not here, or refuses to read this folder"
REUSED = "the root seed was registered with something else, too"
TOO_LATE = "a run was made before the registration was committed"


def test_what_was_registered_before_the_first_run_is_confirmatory(registered: Path):
    assert standing() == {"confirmatory": True, "seed": SEED, "before": [], "at": "2026-05-02 12:00 UTC"}


def test_the_commits_time_is_given_in_utc(project: Path, monkeypatch: pytest.MonkeyPatch):
    register_now(monkeypatch)
    commit("2026-05-03T01:30:00+14:00")
    ran(AFTER, RUNS[0])
    ran(AFTER, RUNS[1])
    assert standing()["at"] == "2026-05-02 11:30 UTC"


def test_later_commits_of_other_files_change_nothing(registered: Path):
    Path("README.md").write_text("Results.\n", encoding="utf-8")
    commit(LATER)
    assert not why()


# What is here is not what was registered.


@pytest.mark.parametrize("spoil", [Path.unlink, lambda path: path.write_text("{", encoding="utf-8")])
def test_a_registration_that_cannot_be_read(registered: Path, spoil: Callable[[Path], object]):
    spoil(paths.REGISTERED)
    assert why() == "reports/registered.json cannot be read"


@pytest.mark.parametrize("text", ["[]", "{}", "null"])
def test_a_registration_of_nothing(registered: Path, text: str):
    paths.REGISTERED.write_text(text, encoding="utf-8")
    assert why() == "reports/registered.json is no registration"


@pytest.mark.parametrize(
    ("path", "old", "new", "named"),
    [
        (paths.PARAMS, f"seed: {SEED} #", f"seed: {SEED + 1} #", "seed, params"),
        (paths.PARAMS, "gamma: 0.1 #", "gamma: 0.2 #", "params"),
        (paths.PARAMS, "seeds: 20 #", "seeds: 21 #", "params"),
        (CLAIMS, "P_MOVE = 0.05 ", "P_MOVE = 0.04 ", "claims"),
        (Path("mimo/science/judgement.py"), "LEVEL = 0.95 ", "LEVEL = 0.9 ", "claims"),
        (Path("mimo/science/analysis.py"), "LATE = 300 ", "LATE = 200 ", "claims"),
        (paths.READINGS, "# Readings\n", "# Other readings\n", "readings"),
    ],
)  # fmt: skip
def test_what_was_changed_is_named(registered: Path, path: Path, old: str, new: str, named: str):
    changed(path, old, new)
    assert why() == f"not as registered: {named}"
    commit(LATER)
    assert why() == f"not as registered: {named}"


def test_what_changes_no_number_that_a_claim_is_judged_by(registered: Path):
    changed(paths.PARAMS, "run: cais/seed-000 #", "run: rtl/seed-001 #")
    changed(paths.PARAMS, "width: 1280 #", "width: 640 #")
    changed(paths.PARAMS, "chunk: 5 #", "chunk: 7 #")
    changed(paths.PARAMS, "temperature: 0.3 # paper §3.6", "temperature: 0.30 # as the paper has it")
    assert not why()


# Constants that came after the registration that stands.


def whole(constants: dict[str, Any]) -> str:
    """The digest of all constants, as it was before any came later."""
    del constants["film"], constants["sweep"]["chunk"]
    for later in ("kl", "mmd", "rnd", "progress", "cai"):  # rewards that came later, and no claim is of
        del constants["rewards"][later]
    return str(identity.Digest(constants))


def test_constants_that_came_later_change_nothing_where_they_are_neutral(project: Path):
    """Each but for the value at which it does what was done before there was a choice."""
    p = params.load()
    constants = p.model_dump(mode="json")
    later: dict[str, dict[str, Any]] = dict(registration.LATER)  # type: ignore[arg-type]
    for section, own in later.items():
        for name, neutral in own.items():
            if isinstance(neutral, dict):
                assert {key: constants[section][name].pop(key) for key in neutral} == neutral
            else:
                assert constants[section].pop(name) == neutral
    assert registration.registered(p)["params"] == whole(constants)
    assert registration.registered(p)["params"] != whole(p.model_dump(mode="json"))


def test_the_projects_constants_are_as_its_registration_has_them():
    """If its root seed is: to register anew takes another."""
    held = json.loads((ROOT / paths.REGISTERED).read_text(encoding="utf-8"))
    if held["seed"] == SEED:
        assert registration.registered(params.load(ROOT / paths.PARAMS))["params"] == held["params"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("draw: 0 #", "draw: 1 #"),
        ("limbs: own #", "limbs: all #"),
        ("action: joint #", "action: limb #"),
        ("rope_holds: 1.0 #", "rope_holds: 0.5 #"),
        ("weight: 1.0 #", "weight: 0.5 #"),
    ],
)
def test_at_another_value_they_do(registered: Path, old: str, new: str):
    changed(paths.PARAMS, old, new)
    assert why() == "not as registered: params"


def test_constants_of_rewards_that_no_claim_is_of_change_nothing(project: Path):
    p = params.load()
    without = params.changed(p, {"sweep.rewards": ["mtl", "rtl_cais", "cais"]})
    assert registration.registered(without)["params"] != registration.registered(p)["params"]
    for key, value, counts in (
        ("rewards.surprise.pays", "move", False),
        ("rewards.surprise.weight", 0.5, False),
        ("rewards.cais.pays", "taken", True),
        ("rewards.rtl.frames", 4, True),  # of a part
        ("rewards.gain", 1.0, True),
        ("rewards.scale", "running", True),
    ):
        one, other = (registration.registered(params.changed(own, {key: value}))["params"] for own in (p, without))
        assert one != registration.registered(p)["params"]
        assert (other != registration.registered(without)["params"]) == counts


def test_comments_and_docstrings_of_claims_change_nothing(registered: Path):
    changed(CLAIMS, '"""Change of a curve\'s mean from one window to another."""', '"""Otherwise said."""')
    changed(CLAIMS, "# rank correlation", "# another comment")
    changed(CLAIMS, "\n# The claims.\n", "\n\n# What the paper claims.\n")
    assert not why()


def test_line_ends_change_nothing(registered: Path):
    for path in (paths.READINGS, paths.PARAMS, *registration.CLAIMS):
        data = path.read_bytes()
        assert b"\r" not in data
        path.write_bytes(data.replace(b"\n", b"\r\n"))
    assert not why()


# Git does not bear it out.


def test_a_registration_never_committed(project: Path, monkeypatch: pytest.MonkeyPatch):
    register_now(monkeypatch)
    ran(AFTER, RUNS[0])
    ran(AFTER, RUNS[1])
    assert why() == NOT_IN_GIT
    git("add", "-A")
    assert why() == NOT_IN_GIT


@pytest.mark.parametrize("staged", [False, True])
def test_a_registration_changed_since_it_was_committed(registered: Path, staged: bool):
    changed(paths.READINGS, "# Readings\n", "# Other readings\n")
    register_anyhow()
    if staged:
        git("add", "-A")
    assert why() == NOT_IN_GIT


def test_without_git(registered: Path, monkeypatch: pytest.MonkeyPatch):
    with monkeypatch.context() as patch:
        patch.setenv("PATH", "")
        assert why() == NO_GIT
    shutil.rmtree(".git")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(registered.parent))
    assert why() == NO_GIT


def test_a_shallow_clone_does_not_say_when(registered: Path, monkeypatch: pytest.MonkeyPatch):
    for name, depth in (("shallow", ("--depth", "1")), ("whole", ())):
        git("clone", "-q", *depth, registered.as_uri(), str(registered.parent / name))
        shutil.copytree(".work", registered.parent / name / ".work")
    monkeypatch.chdir(registered.parent / "shallow")
    assert why() == "this clone is shallow; `git fetch --unshallow` brings git's history"
    monkeypatch.chdir(registered.parent / "whole")
    assert not why()


def test_another_file_with_the_bit_set_or_the_index_told_to_look_away(registered: Path):
    paths.REGISTERED.chmod(0o755)
    assert not why()
    git("update-index", "--assume-unchanged", str(paths.REGISTERED))
    changed(paths.PARAMS, f"seed: {SEED} #", f"seed: {SEED + 1} #")
    register_anyhow()
    assert why() == NOT_IN_GIT


def test_signatures_that_git_would_show_are_in_nobodys_way(registered: Path):
    git("config", "log.showSignature", "true")
    assert not why()


def test_a_seed_that_served_is_refused(registered: Path, monkeypatch: pytest.MonkeyPatch):
    register_now(monkeypatch)  # the same again
    changed(paths.READINGS, "# Readings\n", "# Other readings\n")
    with pytest.raises(console.StageError, match=f"Root seed {SEED} was registered with something else: set another"):
        register_now(monkeypatch)


def test_a_root_seed_serves_once(registered: Path):
    changed(paths.READINGS, "# Readings\n", "# Other readings\n")
    register_anyhow()
    commit("2026-05-02T13:00:00+00:00")
    assert why() == REUSED


def test_a_root_seed_serves_once_on_whatever_branch(registered: Path):
    git("checkout", "-q", "-b", "side")
    changed(paths.READINGS, "# Readings\n", "# Other readings\n")
    register_anyhow()
    commit(LATER)
    git("checkout", "-q", "-")
    git("merge", "-q", "-s", "ours", "--no-edit", "side")
    assert why() == REUSED


def test_the_same_registration_committed_again_counts_from_then(registered: Path):
    held = paths.REGISTERED.read_text(encoding="utf-8")
    paths.REGISTERED.write_text(held.replace("  ", " "), encoding="utf-8")
    commit("2026-05-02T13:00:00+00:00")
    assert standing() == {"confirmatory": True, "seed": SEED, "before": [], "at": "2026-05-02 13:00 UTC"}


def test_another_root_seed_may_be_registered_anew(registered: Path, monkeypatch: pytest.MonkeyPatch):
    changed(paths.READINGS, "# Readings\n", "# Other readings\n")
    changed(paths.PARAMS, f"seed: {SEED} #", f"seed: {SEED + 1} #")
    register_now(monkeypatch)
    commit("2026-05-02T13:00:00+00:00")
    assert standing() == {"confirmatory": True, "seed": SEED + 1, "before": [SEED], "at": "2026-05-02 13:00 UTC"}


# When the runs were made.


@pytest.mark.parametrize("at", [BEFORE, AT])
def test_one_run_that_was_there_before(registered: Path, at: str):
    ran(at, RUNS[1])
    assert why() == TOO_LATE


def test_a_run_computed_again_counts_from_its_first_time(project: Path, monkeypatch: pytest.MonkeyPatch):
    for digest in RUNS:
        ran(BEFORE, digest)
    register_now(monkeypatch)
    commit(AT)
    for digest in RUNS:
        ran(AFTER, digest)
    assert why() == TOO_LATE


def test_without_any_run_nothing_is_confirmed(registered: Path):
    assert registration.standing(params.load(), ())["why"] == "when the runs were made is not known here"


def test_damaged_records_of_times_are_passed_over(registered: Path):
    with paths.provenance().open("a", encoding="utf-8") as file:
        for line in (
            "[1]",
            "{",
            *(json.dumps(damaged | {"digest": RUNS[0]}) for damaged in ({}, {"at": "x"}, {"at": 5})),
        ):
            file.write(f"\n{line}")
        file.write('\n{"digest": []}')
    assert not why()


@pytest.mark.parametrize(
    "text", ["[]", "null", '{"made": {}}', '{"made": []}', '{"made": {"run": {"first": 5}}}',
             '{"made": {"run": {"first": "yesterday"}}}', '{"made": {"run": {"first": "2026-05-03T12:00:00"}}}'],
)  # fmt: skip
def test_damaged_sums_of_the_published_are_passed_over(registered: Path, text: str):
    paths.PUBLISHED_ON.write_text(text, encoding="utf-8")
    assert not why()
    paths.provenance().unlink()
    assert why() == "when the runs were made is not known here"


def test_other_runs_do_not_count(registered: Path):
    ran(BEFORE, "c" * 64)
    assert not why()


@pytest.mark.parametrize("known", [(), RUNS[:1]])
def test_runs_of_which_no_time_is_known(registered: Path, known: tuple[str, ...]):
    paths.provenance().unlink()
    for digest in known:
        ran(AFTER, digest)
    assert why() == "when the runs were made is not known here"


@pytest.mark.parametrize("known", [(), RUNS[:1]])
@pytest.mark.parametrize(("first", "expected"), [(AFTER, ""), (BEFORE, TOO_LATE)])
def test_of_fetched_runs_the_published_ones_sum_has_it(
    registered: Path, known: tuple[str, ...], first: str, expected: str
):
    paths.provenance().unlink()
    for digest in known:
        ran(LATER, digest)
    published(first)
    assert why() == expected


def test_a_run_known_here_is_older_than_the_published_sum_says(registered: Path):
    paths.provenance().unlink()
    ran(BEFORE, RUNS[0])
    published(AFTER)
    assert why() == TOO_LATE


def test_the_published_sum_does_not_count_where_all_runs_are_known_here(registered: Path):
    published(BEFORE)
    assert not why()
