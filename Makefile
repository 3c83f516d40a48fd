# make paper | studies | watch | verify | register | publish | share | fetch | preview | test | same-bytes | check | format | bench | scaling. `make` alone lists them.

# The interpreter for .venv: the first of these that is Python 3.11 to 3.13, unless PYTHON names another.
PYTHONS := $(or $(PYTHON),python3 python3.13 python3.12 python3.11)
SYSTEM_PATH := $(PATH)
export PATH := $(CURDIR)/.venv/bin:$(PATH)
export DVC_NO_ANALYTICS := 1
export RAY_USAGE_STATS_ENABLED := 0

STAMP := .venv/.stamp

.DEFAULT_GOAL := help
.PHONY: help paper studies watch verify register publish share fetch preview test same-bytes check format bench scaling .venv

help: ## List the commands
	@sed -n 's/^\([a-z.-]*\):.*## \(.*\)/make \1\t\2/p' Makefile | expand -t 16

paper: $(STAMP) ## Every figure, table and claim of the paper: only what is missing is computed
	@python -m stages.commands.gl --install
	@python -m stages.commands.paper

studies: $(STAMP) ## What goes beyond the paper, whose results it needs and leaves alone: make studies [STUDY=noise]
	@python -m stages.commands.gl --install
	@python -m stages.commands.studies $(STUDY)

watch: $(STAMP) ## From another terminal: what a running sweep or stage does, runs done, time left, last fault
	@python -m stages.commands.watch

verify: $(STAMP) ## Compute a sample of the published artifacts again and compare
	@python -m stages.commands.gl --install
	@python -m stages.commands.verify

register: $(STAMP) ## Before the runs: write down what is decided, reports/registered.json, to be committed alone
	@python -m stages.commands.register

publish: $(STAMP) ## Say on which machines the published artifacts were made: reports/published-on.json
	@python -m stages.commands.publish

share: $(STAMP) ## Send the results to a DVC remote: make share [REMOTE=s3://bucket/folder]
	@python -m stages.commands.share push $(REMOTE)

fetch: $(STAMP) ## Get the results of this commit, and others' run cache: make fetch [REMOTE=s3://bucket/folder]
	@python -m stages.commands.share fetch $(REMOTE)

preview: $(STAMP) ## Both pipelines at a small scale, in .work/preview
	@python -m stages.commands.gl --install
	@python -m stages.commands.preview

# One worker more than there are processors: many a test waits for processes of its own.
test: $(STAMP) ## The whole test suite
	@python -m stages.commands.gl --install
	python -m pytest -n $$(($$(getconf _NPROCESSORS_ONLN) + 1)) --dist loadfile --no-loadscope-reorder

same-bytes: $(STAMP) ## Compute under QEMU as other processors, and compare: a quarter of an hour
	@command -v qemu-x86_64-static qemu-x86_64 >/dev/null || { echo "Install qemu-user-static (Debian)."; exit 1; }
	MIMO_SAME_BYTES=1 python -m pytest -q tests/pipeline/test_other_processors.py

check: $(STAMP) ## Format, lint, floors, types
	ruff format --check .
	ruff check .
	lint-imports --no-cache
	mypy

format: $(STAMP) ## Put the code in the project's format
	ruff format .
	ruff check --fix .

bench: $(STAMP) ## Time an agent step
	python -m benchmarks.agent_step

scaling: $(STAMP) ## Time the scheduler on up to 1,000 simulated workers
	python -m benchmarks.scaling

.venv: $(STAMP) ## The locked environment; made anew where requirements.lock has changed

$(STAMP): requirements.lock
	@test -x .venv/bin/pip || { export PATH="$(SYSTEM_PATH)"; \
	  for python in $(PYTHONS); do \
	    "$$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null && break; \
	  done || { echo "Python 3.11 to 3.13 is needed; none of these is one: $(PYTHONS)."; exit 1; }; \
	  "$$python" -m venv .venv >/dev/null || { \
	  : "Debian's Python may lack ensurepip: pip then comes by the system's pip"; \
	  "$$python" -m venv --clear --without-pip .venv && "$$python" -m pip --python .venv/bin/python install -qq pip; }; }
	@echo "Installing requirements.lock into .venv"
	@.venv/bin/python -m pip install -qq --disable-pip-version-check -r requirements.lock
	@.venv/bin/python -c 'import platform, torch; print(f"Python {platform.python_version()}, PyTorch {torch.__version__}:", \
	  f"the build for CUDA {torch.version.cuda}, though no GPU is needed" if torch.version.cuda else "the CPU build")'
	@touch $@

# What PyTorch's CUDA build brings, in a folder of its own: tests/unit/record/test_runtime.py needs it where that build is not.
.venv/triton: $(STAMP)
	@.venv/bin/python -m pip install -qq --disable-pip-version-check --no-deps --target $@ triton==3.7.1
	@touch $@
