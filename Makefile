# make run     sets everything up, runs case 3 (quick) on three engines, ends with the path of the report
# make test    sets everything up, runs the tests on the cores that there are
# make verify  sets everything up, runs the suites of known answers, ends with the path of the page
# make bench   times the solver's kernels beside the baseline, and the engines side by side (BENCH="--scene bed25k")
# make slow    the tests that take minutes: physics on full beds, planted regressions
# make lint    style and types
# make clean   removes .venv, caches and builds; runs and reports stay

PYTHON ?= python3
OUT ?= runs
BENCH ?= --scene scaling-5k --steps 5000
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.DEFAULT_GOAL := test
.PHONY: run test verify bench slow lint clean engines browser

run: $(READY) engines
	@$(BIN)/dembench run case3 --out $(OUT) \
	  --engines peclet,peclet-hertz$$(command -v liggghts >/dev/null && echo ,liggghts)

test: $(READY) engines browser
	$(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile --benchmark-disable

verify: $(READY)
	@$(BIN)/dembench verify --engines peclet --out $(OUT)/verify

bench: $(READY) engines
	@mkdir -p $(OUT)
	$(BIN)/python -m pytest tests/bench/test_kernels.py -m slow --benchmark-json=$(OUT)/kernels.json
	$(BIN)/dembench check $(OUT)/kernels.json --baseline data/baselines/kernels.json
	$(BIN)/dembench bench $(BENCH) --out $(OUT)/bench

slow: $(READY) engines
	$(BIN)/python -m pytest -m slow

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy dembench

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "dembench needs Python 3.11 or newer: make PYTHON=...")'
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Installing dembench and its test tools into $(VENV)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	@touch $@

# $(call debian,PROGRAM,PACKAGES,WHAT WE GO ON WITHOUT): installs Debian packages where that is possible
define debian
	@command -v $(1) >/dev/null || \
	if command -v apt-get >/dev/null && [ "$$(id -u)" = 0 ]; then \
	  echo "Installing $(2)"; \
	  { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-install-recommends $(2) >/dev/null; } \
	  || echo "$(2) could not be installed; going on without $(3)"; \
	else \
	  echo "$(1) is missing: going on without $(3). To get it: sudo apt-get install $(2)"; \
	fi
endef

engines:
	$(call debian,liggghts,liggghts openmpi-bin,the engine liggghts)

browser:
	$(call debian,chromedriver,chromium chromium-driver,the browser test of the report)
