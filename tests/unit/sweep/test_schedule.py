"""The schedule: every run once, in chunks of one cell that shrink towards the end, the longest before the short."""

from hypothesis import given
from hypothesis import strategies as st

from stages.sweep.schedule import Chunk, Run, Schedule

CELLS = st.tuples(
    st.sampled_from(["free", "noisy"]), st.sampled_from(["mtl", "rtl", "cais", "surprise", "mtl_surprise"])
)
RUNS = st.dictionaries(CELLS, st.sets(st.integers(0, 12), min_size=1), max_size=8).map(
    lambda cells: [
        Run(condition, reward, seed, f"{condition}{reward}{seed}")
        for (condition, reward), seeds in cells.items()
        for seed in sorted(seeds)
    ]
)


def handed_out(runs: list[Run], size: int, workers: int) -> list[Chunk]:
    schedule, found = Schedule(runs, size), []
    while chunk := schedule.next(workers):
        found.append(chunk)
    assert schedule.next(workers) is None
    return found


@given(RUNS, st.integers(1, 6), st.integers(1, 20))
def test_every_run_is_handed_out_once_with_others_of_its_cell(runs: list[Run], size: int, workers: int) -> None:
    made = handed_out(runs, size, workers)
    assert sorted(run.digest for chunk in made for run in chunk.runs) == sorted(run.digest for run in runs)
    for chunk in made:
        assert 1 <= len(chunk.runs) <= size
        assert len({(run.condition, run.reward) for run in chunk.runs}) == 1
        assert [run.seed for run in chunk.runs] == sorted(run.seed for run in chunk.runs)


@given(RUNS, st.integers(1, 6), st.integers(1, 20))
def test_low_seeds_come_first_then_outcome_models(runs: list[Run], size: int, workers: int) -> None:
    firsts = [chunk.runs[0] for chunk in handed_out(runs, size, workers)]
    ranks = [(run.seed, run.reward in ("mtl", "rtl")) for run in firsts]
    assert ranks == sorted(ranks)


@given(RUNS.filter(len), st.integers(1, 6), st.integers(1, 20))
def test_no_chunk_is_more_than_a_workers_share_of_what_is_left(runs: list[Run], size: int, workers: int) -> None:
    left = len(runs)
    for chunk in handed_out(runs, size, workers):
        assert len(chunk.runs) <= 2 or (len(chunk.runs) - 1) * workers < left
        left -= len(chunk.runs)


def test_the_paper_on_two_workers_has_whole_chunks_then_smaller_ones() -> None:
    runs = [Run(c, r, s, f"{c}{r}{s}") for c in ("free", "noisy") for r in ("mtl", "cais") for s in range(10)]
    sizes = [len(chunk.runs) for chunk in handed_out(runs, 5, 2)]
    assert sizes == [5, 5, 5, 5, 5, 4, 3, 2, 2, 2, 1, 1]


def test_where_some_workers_must_do_two_runs_they_do_them_together() -> None:
    runs = [Run("free", "cais", seed, f"{seed}") for seed in range(14)]
    assert [len(chunk.runs) for chunk in handed_out(runs, 5, 10)] == [2] * 4 + [1] * 6


@given(RUNS.filter(len), st.integers(2, 6))
def test_the_runs_of_a_failed_chunk_come_again_one_by_one(runs: list[Run], size: int) -> None:
    schedule = Schedule(runs, size)
    chunk = schedule.next(1)
    assert chunk is not None
    if schedule.apart(chunk):
        again = [schedule.next(1) for _ in chunk.runs]
        assert again == [Chunk((run,)) for run in chunk.runs]
    else:
        assert len(chunk.runs) == 1


def test_a_chunk_is_named_for_people() -> None:
    assert Chunk((Run("free", "mtl", 3, "a"), Run("free", "mtl", 4, "b"))).name == "free, mtl, seed 3, 4"
    assert Chunk((Run("free", "mtl", 3, "a", "greedy"),)).name == "greedy: free, mtl, seed 3"
