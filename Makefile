# make demo    set everything up, make a phantom with a hidden fault, find it, open the page   (ARGS="--no-serve" ends after the table)
# make test    set everything up, run the default tier of the tests     make test-more   the rest (make test ARGS="-m slow": soaks)
# make check   lint, format, types, layers, structure, page             make docs        the documentation, links checked
# make bench   speed and accuracy of the engine, and of others          make clean       remove .venv and all caches
# PYTHON=...   another Python 3.11

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
PIP := $(VENV)/bin/python -m pip
ARGS ?=
PAGE := .ci/page
PAGE_TOOLS := $(PAGE)/node_modules/.bin
# Two workers, a file to each, the longest first. One that dies ends the run at once with the name of its test: replaced, it would
# leave tests that nobody is given, and the run would wait for ever.
SPREAD := -n 2 --dist loadfile --no-loadscope-reorder --max-worker-restart=0

# Palpate spreads work over processes; threads inside them would fight for the same cores.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= 1
export NUMBA_NUM_THREADS ?= 1

.PHONY: demo test test-more bench check check-page docs licences names types-of-code types-of-tests clean install develop
.DELETE_ON_ERROR:

demo: install
	$(VENV)/bin/palpate demo $(ARGS)

test: develop
	$(VENV)/bin/python -m pytest -m "not slow and not more" $(SPREAD) $(ARGS)

test-more: develop
	$(VENV)/bin/python -m pytest -m "more and not slow" $(SPREAD) $(ARGS)

bench: $(VENV)/.peers
	$(VENV)/bin/python -m benchmarks $(ARGS)

check: develop check-page names
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	.ci/packages --check
	.ci/structure
	PYTHONPATH=build/names $(VENV)/bin/lint-imports --no-cache
	$(MAKE) --no-print-directory -j2 --output-sync=target types-of-code types-of-tests

# The page is plain ES modules: the tools only check it.
check-page: $(PAGE)/node_modules/.installed
	$(PAGE_TOOLS)/eslint --config $(PAGE)/eslint.config.mjs static/js
	$(PAGE_TOOLS)/tsc --project $(PAGE)/tsconfig.json
	$(PAGE_TOOLS)/prettier --config $(PAGE)/prettier.json --log-level warn --check \
	    'static/**/*.{js,ts,css,html}' '!static/vendor/**'

# The folders as they are installed, for tools that cannot follow an editable installation.
names:
	@.ci/link-tree

# NO_MKDOCS_2_WARNING: an advertisement of the theme, no warning about these pages.
docs: $(VENV)/.documented names
	$(VENV)/bin/python docs/draw_architecture.py
	NO_MKDOCS_2_WARNING=1 $(VENV)/bin/mkdocs build --quiet --strict -f docs/mkdocs.yml
	$(VENV)/bin/python -m pytest -q tests/docs -m "not slow and not more"

# Side by side, each with a cache of its own: they check by other rules.
types-of-code:
	$(VENV)/bin/mypy --cache-dir .mypy_cache/code

types-of-tests:
	MYPYPATH=tests:. $(VENV)/bin/mypy --cache-dir .mypy_cache/tests --explicit-package-bases --allow-untyped-defs \
	    --allow-incomplete-defs --allow-untyped-calls --no-warn-return-any --no-warn-unused-ignores tests benchmarks

# The licences of all that is installed, as a table.
licences: develop
	@$(VENV)/bin/pip-licenses --from=mixed --order=license --format=markdown

clean:
	rm -rf $(VENV) $(PAGE)/node_modules build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find app core tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +

install: $(VENV)/.system-demo $(VENV)/.installed
develop: $(VENV)/.system-test $(VENV)/.developed

# Each step leaves its stamp only when it succeeded, so that a second call is instant and a failed one is repeated.
$(VENV)/.created:
	@test -n "$(PYTHON)" || { echo "Python 3.11 was not found: install it, or say where it is with make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "$(PYTHON) is older than Python 3.11: say where 3.11 is with make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { echo "No virtual environment could be made: on Debian and Ubuntu, apt-get install python3.11-venv"; exit 1; }
	@touch $@

$(VENV)/.system-%: .ci/system | $(VENV)/.created
	@.ci/system $*
	@touch $@

# torch first and alone: the exact pin lets pip take a CPU build where there is one; a looser one fetches gigabytes of CUDA.
$(VENV)/.torch: constraints.txt | $(VENV)/.created
	$(PIP) install --quiet "$$(grep '^torch==' constraints.txt)" -c constraints.txt
	@touch $@

# Every file is compared with its hash; --no-build-isolation, so that Palpate is built by the setuptools among them.
$(VENV)/.installed: pyproject.toml .ci/requirements.txt $(VENV)/.torch
	$(PIP) install --quiet --no-deps --require-hashes -r .ci/requirements.txt
	$(PIP) install --quiet --no-deps --no-build-isolation -e .
	@touch $@

$(VENV)/.peers: pyproject.toml constraints.txt $(VENV)/.system-bench $(VENV)/.installed
	$(PIP) install --quiet -e ".[peers,shapes,cluster]" -c constraints.txt
	@touch $@

$(VENV)/.developed: pyproject.toml constraints.txt $(VENV)/.installed
	$(PIP) install --quiet -e ".[test,check,shapes,cluster]" -c constraints.txt
	@touch $@

$(PAGE)/node_modules/.installed: $(PAGE)/package.json $(PAGE)/package-lock.json | $(VENV)/.system-test
	npm ci --prefix $(PAGE) --no-progress
	@touch $@

$(VENV)/.documented: pyproject.toml constraints.txt $(VENV)/.developed
	$(PIP) install --quiet -e ".[docs]" -c constraints.txt
	@touch $@
