# Two commands on a bare machine with Python 3.11+, pip and make: `make adapt` and `make test`.
PYTHON ?= python3
BIN := .venv/bin
# uv takes a tenth of the time of pip.
INSTALL := $(BIN)/uv pip install -q --python $(BIN)/python
MOTIONS ?= ../shared/motions/*.csv
MEANS ?= --mean mean_ludewig2009 --mean mean_oki2012

# Where it is set, every process compiles all that it imports anew: three seconds each, and the tests start hundreds.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: adapt test quick lint types units lock blind recovery heldout sets tables completion unpublished questions thesis speed studies fuzz mutants rooms frames docs clean

adapt: .venv/runtime ## adapt the ten shipped (simulated) subjects with R2, R4 and R6
	$(BIN)/girdle adapt motions/data/simulated_subjects.csv --model R2 --model R4 --model R6 --out out/adapt

test: .venv/dev .venv/docs ## everything that must hold: style, types, pages, tests; types and pages are checked beside the first tests
	$(MAKE) --no-print-directory -j2 lint types docs units

quick: lint ## after every change, in under a minute: style, and the tests that are not marked slow
	$(BIN)/pytest -m "not slow"

lint: .venv/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m scripts.words

# With more room for what is new the garbage collector works less: 4 to 15 % of all CPU time.
types: .venv/dev
	NODE_OPTIONS=--max-semi-space-size=128 $(BIN)/pyright

units: .venv/dev
	$(BIN)/pytest

lock: .venv/dev ## after a change of dependencies in pyproject.toml
	$(BIN)/uv pip compile -q --universal --python-version 3.11 --generate-hashes pyproject.toml -o requirements.lock
	$(BIN)/uv pip compile -q --universal --python-version 3.11 --generate-hashes --extra dev -c requirements.lock pyproject.toml -o requirements-dev.lock
	$(BIN)/uv pip compile -q --universal --python-version 3.11 --generate-hashes --extra peers -c requirements-dev.lock pyproject.toml -o requirements-peers.lock
	$(BIN)/uv pip compile -q --universal --python-version 3.11 --generate-hashes --extra docs -c requirements-dev.lock pyproject.toml -o requirements-docs.lock
	echo uv | $(BIN)/uv pip compile -q --universal --python-version 3.11 --generate-hashes -c requirements-dev.lock - -o requirements-uv.lock

studies: .venv/dev ## the tests of the studies themselves, which guard nothing that runs; after a change in scripts/research
	$(BIN)/pytest scripts/research/tests

blind: .venv/runtime ## the withheld-effect check on simulated subjects: hours, resumable; prints its figures
	$(BIN)/python scripts/research/named_causes/blind_check.py --out out/blind

fuzz: .venv/dev ## thousands of broken files through every reader: half an hour; prints what became of them
	$(BIN)/python scripts/fuzz_readers.py --inputs 2000 --keep out/fuzz

mutants: .venv/dev ## small faults put into the numerical core: which of them do the tests not notice? an hour
	$(BIN)/python scripts/mutate_core.py --mutants 40

recovery: .venv/runtime ## do the intervals of adapted parameters hold the truth? simulated subjects; prints its figures
	$(BIN)/python scripts/research/trust/study_recovery.py

heldout: .venv/runtime ## adapted to one motion, tested on the other; w by held-out motions; of measured motions
	$(BIN)/python scripts/research/trust/study_heldout.py $(MOTIONS) --weights

sets: .venv/runtime ## what depends on the cadaver; of measured motions
	$(BIN)/python scripts/research/trust/study_sets.py $(MOTIONS)

completion: .venv/runtime ## how what is not printed of R2, R4 and R6 is best placed: two minutes; of measured motions
	$(BIN)/python scripts/research/thesis/study_completion.py $(MOTIONS) $(MEANS)

unpublished: .venv/runtime ## which unpublished number decides the thesis's tables: minutes; of measured motions
	$(BIN)/python scripts/research/thesis/study_unpublished.py $(MOTIONS) $(MEANS)

tables: .venv/runtime ## the thesis's tables beside ours, and which objective variant is the thesis's: minutes; of measured motions
	$(BIN)/girdle compare $(MOTIONS) $(MEANS) --model R2 --model R4 --model R6 --out out/compare
	$(BIN)/python scripts/research/thesis/study_objective.py $(MOTIONS) $(MEANS:--mean=--leave-out)

questions: .venv/runtime ## what measured motions say of the questions of chapter 7: a minute
	$(BIN)/girdle questions $(MOTIONS) $(MEANS) --model R2 --model R4 --model R6 --out out/questions

thesis: tables completion questions ## all that measured motions say of the thesis: minutes; prints Markdown

speed: .venv/dev .venv/peers ## the fits against other solvers, and where their time goes: a quarter of an hour; simulated subjects
	$(BIN)/python scripts/benchmark.py --subjects 1000 --peers 30 --repeats 5
	$(BIN)/python scripts/research/speed/measure_roofline.py

rooms: .venv/runtime ## the drawing of the rooms, docs/rooms.svg, from the imports in the source
	$(BIN)/python scripts/draw_rooms.py

docs: .venv/docs ## the documentation site in out/site, from README, docs/*.md and the docstrings; a broken link is an error
	$(BIN)/sphinx-build -q -E -a -W --keep-going -c docs/site -d out/doctrees . out/site
	@echo "out/site/index.html"

frames: .venv/runtime ## the pictures of frames and signs, docs/frames*.svg, from the parameter set R2
	$(BIN)/python scripts/draw_frames.py

.venv/bin/python:
	$(PYTHON) -m venv .venv

.venv/uv: .venv/bin/python requirements-uv.lock
	$(BIN)/pip install -q --disable-pip-version-check --require-hashes -r requirements-uv.lock
	touch $@

.venv/runtime: .venv/uv requirements.lock pyproject.toml
	$(INSTALL) --require-hashes -r requirements.lock
	$(INSTALL) --no-deps -e .
	touch $@

.venv/dev: .venv/runtime requirements-dev.lock
	$(INSTALL) --require-hashes -r requirements-dev.lock
	touch $@

# Some peers have no wheel for some systems: the benchmark says what it leaves out.
.venv/peers: .venv/dev requirements-peers.lock
	-$(INSTALL) --require-hashes -r requirements-peers.lock
	touch $@

.venv/docs: .venv/runtime requirements-docs.lock
	$(INSTALL) --require-hashes -r requirements-docs.lock
	touch $@

clean:
	rm -rf .venv out build dist
