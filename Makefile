# The two commands: `make run` and `make test`. Both make .venv first and need only Python 3.11 and make.
PORT ?= 8000
HOST ?= 127.0.0.1
SERVICE := .venv/.service
STAMP := .venv/.installed

.PHONY: help docs atlas notebooks install develop service run test wheel installed nightly lint paper bench bench-service records soundness coverage mutation golden font reference screens clients

help: ## this list
	@sed -n 's/^\([a-z-]*\):[^#]*## /\1: /p' Makefile

# What the service and the command line need; what tests and development need besides.
service: $(SERVICE) ## the environment of `make run`
install: $(STAMP)
develop: install ## the environment of developers, .venv
# The first interpreter that is new enough; `make PYTHON=/path/to/python` overrules the search.
define FIND_PYTHON
found=; for candidate in $(PYTHON) python3 python3.11 python3.12 python3.13 python3.14 python; do \
  if $$candidate -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then found=$$candidate; break; fi; \
done; \
if [ -z "$$found" ]; then echo "Python 3.11 or newer is needed; none was found." >&2; exit 1; fi
endef

$(SERVICE): pyproject.toml constraints.txt
	@$(FIND_PYTHON); set -e; \
	if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then \
	  $$found -m venv --clear .venv || { \
	    echo "This Python cannot make an environment: install its venv package (Debian: python3-venv)." >&2; exit 1; }; \
	fi
	@echo "Installing the packages of the service into .venv (550 MB, once); this takes a minute or two."
	.venv/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[all]'
	@echo "Compiling the sources."
	@# Sources and modular kernels are compiled once, here, and not in the first call of a user: where Python may write
	@# no bytecode (PYTHONDONTWRITEBYTECODE), every call would compile the sources again, which takes 0.2 s.
	.venv/bin/python -m compileall -q inverse_service api_schemas
	@# The first question compiles the kernels of a clone, which no other question then waits for.
	@.venv/bin/inverse-service solve "x'' = -x" --format json > /dev/null
	@touch $(SERVICE)

$(STAMP): $(SERVICE)
	@echo "Installing what tests and documentation need (1 GB more, once)."
	.venv/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $(STAMP)

run: service ## serve the pages and HTTP on 127.0.0.1:8000 (PORT=, HOST=)
	.venv/bin/inverse-service serve --host $(HOST) --port $(PORT)

# Bytecode is kept, whatever the shell says: else each process compiles tests and package again.
test: install ## the tests
	PYTHONDONTWRITEBYTECODE= .venv/bin/python -m pytest -n logical --dist loadfile --no-loadscope-reorder

# Neither uses .venv: what a stranger gets is built and asked as a stranger would.
wheel: ## the wheel with its kernels and the source archive, build/wheel
	@$(FIND_PYTHON); $$found tests/wheel.py build/wheel

installed: wheel ## ten questions to the wheel in an empty environment
	@$(FIND_PYTHON); $$found tests/installed.py build/wheel/*.whl build/environment

nightly: install ## the long tests
	.venv/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev,manifests]'
	.venv/bin/python -m pytest -m 'slow or nightly'
	.venv/bin/python -m pytest -m 'not slow and not nightly' tests/attacks

lint: install ## ruff and mypy
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy

# docs/paper.md and its figures: every statement of the paper computed anew.
paper: install ## docs/paper.md and its figures
	.venv/bin/python -m paper --output docs

# The decision, the peers that are installed, the search, the integrators, as docs/records shows them.
bench: install ## benchmarks of decision and integrators, twenty minutes
	.venv/bin/python -m benchmarks.records docs/records/benchmarks.md docs/records/simulation-speed.md

# The service under load, pool and cluster, the stores; the tables of docs/records/reliability.md are replaced.
bench-service: install ## the service under load
	.venv/bin/python -m benchmarks service --page docs/records/reliability.md
	.venv/bin/python -m benchmarks cluster --lines 200 --rounds 3 $(POSTGRES:%=--postgres %) --page docs/records/reliability.md
	.venv/bin/python -m tests.store.measure_store docs/records/reliability.md

# Every table of docs/records/ that the present program prints; each names the commit that was measured. What compares
# with earlier commits and other servers, kills processes, or judges mutants has its command beside it
# (tests/docs/test_records.py lists them).
records: bench-service paper soundness ## measure docs/records/ again; hours
	.venv/bin/python -m benchmarks hard-cases --long --output docs/records/hard-cases.md
	.venv/bin/python -m benchmarks peers --output docs/records/simulation-peers.md
	.venv/bin/python -m tests.docs.test_known_kinds
	.venv/bin/python -m benchmarks.kind_costs --write
	.venv/bin/python -m benchmarks size --write
	.venv/bin/python -m benchmarks.nearest --write
	.venv/bin/python -m benchmarks.data_sets --write
	.venv/bin/python -m tests.web.browser.screens
	.venv/bin/python -m benchmarks.records

# 26,000 cases on all cores; interrupted, it goes on where it was.
soundness: install ## 26,000 cases with the checker; goes on where it was
	.venv/bin/python -m tests.soundness --output build/soundness --report docs/records/soundness.md

# Branch coverage of the heart by the default tests, children included; methods are data, which simulation runs.
coverage: install ## branch coverage of the heart
	rm -f build/coverage build/coverage.*
	@# The table is printed where a test fails too; the failure is that of the target.
	.venv/bin/python -m coverage run -m pytest -n logical; status=$$?; \
	.venv/bin/python -m coverage combine --quiet && .venv/bin/python -m coverage report && exit $$status

# Small changes to the mathematics, each of which a test has to notice.
mutation: install ## small changes that tests must notice
	.venv/bin/python -m tests.mutation --output build/mutation

# What the working tree answers otherwise than a revision, over a hundred documents.
BASE ?= HEAD
golden: install ## compare a hundred results with those of BASE=REVISION
	.venv/bin/python -m tests.golden --base $(BASE)

# The mathematics font of the pages: the characters that our MathML uses, out of a pinned package. Needs npm.
FONT := inverse_service/web/static/stix-two-math
BASIC := U+20-7E,U+A0,U+A8,U+AF,U+B1-B3,U+B7,U+D7,U+F7,U+2D9,U+2DC,U+391-3A9,U+3B1-3C9,U+3D1,U+3D5,U+3F1,U+3F5
SIGNS := U+300-308,U+2026,U+2032-2034,U+2061-2064,U+2190,U+2192,U+21D2,U+2202,U+2207,U+2208,U+2211,U+2212,U+221A,U+221E,U+222B,U+2260,U+2264,U+2265,U+22C5
ITALIC := U+210E,U+1D434-1D467,U+1D6E2-1D71B
font: install ## the mathematics font of the pages
	mkdir -p build/font
	npm pack --silent --pack-destination build/font @fontsource/stix-two-math@5.3.0
	tar xzf build/font/fontsource-stix-two-math-5.3.0.tgz -C build/font
	.venv/bin/pyftsubset build/font/package/files/stix-two-math-latin-400-normal.woff2 --flavor=woff2 \
	  --layout-features='' --no-hinting --desubroutinize --notdef-outline --unicodes=$(BASIC),$(SIGNS),$(ITALIC) \
	  --output-file=$(FONT).woff2
	cp build/font/package/LICENSE $(FONT).LICENSE

# docs/reference/results.md and docs/inverse-service.1 from the program; tests say when they are old.
reference: install ## docs/reference/results.md and the manual page from the program
	.venv/bin/python -m tests.docs.reference
	.venv/bin/python -m tests.docs.manual

screens: install ## the pictures of fourteen pages, docs/records/screens
	.venv/bin/python -m tests.web.browser.screens

# Both clients of clients/ from the service's own description, and five calls by each. Needs npm.
clients: install ## the generated clients, build/clients
	.venv/bin/python -m tests.client.generated build/clients

atlas: install ## every entry of the atlas from the program, ten minutes of processor time
	.venv/bin/python -m benchmarks.atlas

notebooks: install ## execute the notebooks of docs/ in place
	.venv/bin/python -m tests.docs.notebooks

# The documentation as a site in build/site; a warning is an error, and so is a program of a page, or a notebook, that
# prints something else now.
docs: install ## the documentation as a site, build/site; its programs and notebooks run
	.venv/bin/python -m sphinx --quiet --fail-on-warning --keep-going -b html docs build/site
	.venv/bin/python -m pytest -m slow -n logical tests/docs
