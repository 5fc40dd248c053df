# make demo, make test and make check need only Python >= 3.11: they make .venv, once.
# Another interpreter: make demo PYTHON=/path/to/python3.12

PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11 python; do \
	"$$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo "$$p" && exit; done; echo python3)

VENV  := .venv
PIP   := $(VENV)/bin/python -m pip --disable-pip-version-check
READY := $(VENV)/.ready
DEV   := $(VENV)/.ready-dev
DOCS  := $(VENV)/.ready-docs
IN    := . $(VENV)/bin/activate &&

# other frame programs, to compare with: nothing of theirs is imported, they run in processes of their own
PEERS       := .venv-peers
PEERS_READY := $(PEERS)/.ready

# one thread per process: the tests run in two processes, and the matrices are small or sparse
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= 1
# pictures are drawn off screen; without a display VTK goes straight to EGL instead of first warning about X
export PYVISTA_OFF_SCREEN ?= true
ifeq ($(shell uname -s)$(DISPLAY),Linux)
export VTK_DEFAULT_OPENGL_WINDOW ?= vtkEGLRenderWindow
endif

.PHONY: help demo desk test coverage slow long docs dist fuzz independent a-frames base-motion solids foreign foreign-modes extras peers bench bench-peers check lint types contracts format lock clean
help:
	@echo 'make demo        run the example study, report in out/demo'
	@echo 'make desk        open the example study in a browser: add effects by hand and watch the error fall'
	@echo 'make test        python -m pytest'
	@echo 'make coverage    the same, with the coverage of each package'
	@echo 'make slow        the tests that take more than 5 s each'
	@echo 'make long        those that take minutes: thirty diagnoses of fresh cases, the cases of other codes'
	@echo 'make docs        write outputs and pictures into the pages of docs/, and build the site in out/site; CHECK=1 only compares'
	@echo '                 the pages, FRESH=1 computes all results again, JOBS=1 one by one'
	@echo 'make dist        build wheel and sdist in dist, and check them in clean environments; PYTHONS="python3.11 python3.13"'
	@echo 'make fuzz        damaged files for every reader; MINUTES=10 SEED=3, or COUNT=50000 for each format'
	@echo 'make independent the cases that other codes made: verdicts against the truth'
	@echo 'make a-frames    the same of beams of OpenSees, made here; 15 minutes'
	@echo 'make solids      the same of bars of solid elements, made here; 40 minutes'
	@echo 'make foreign     fresh cases of other codes, drawn from a seed; SEED=3 CASES=40, STRUCTURES="mast bay" for some,'
	@echo '                 TEST=real for tests that are not as described; CAP=600 seconds of CPU a case, JOBS=2'
	@echo 'make foreign-modes the same by measured modes, of one state or two'
	@echo 'make extras      install sectionproperties (sections of any outline) and PARDISO'
	@echo 'make bench       times and errors of everything that claims a speed, without other programs'
	@echo 'make peers       install OpenSeesPy, PyNite, sdypy-EMA and scikit-fem beside Dovetail: tests marked peer then run'
	@echo 'make bench-peers speed and agreement against them; SIZES="8" for a quick one'
	@echo 'make check       ruff, pyright and the import contracts'
	@echo 'make format      let ruff rewrite the code'
	@echo 'make lock        resolve requirements*.lock anew from pyproject.toml'
	@echo 'make clean       remove .venv, out and caches'

demo: $(READY)
	$(IN) dovetail run examples/cross-beam/study.toml --out out/demo

# the desk's packages are among those of the tests
desk: $(DEV)
	$(IN) dovetail open examples/cross-beam/study.toml

test: $(DEV)
	$(IN) python -m pytest

coverage: $(DEV)
	$(IN) python -m pytest --cov --cov-report=term

# commands and examples run, or their results are those of an earlier build in .docs-cache; MkDocs then works without any network
docs: $(DEV) $(DOCS)
	$(IN) python -m docs.make out/docs $(if $(CHECK),--check) $(if $(FRESH),--fresh) $(if $(JOBS),--jobs $(JOBS))
	$(IN) NO_MKDOCS_2_WARNING=1 python -m mkdocs build --quiet --strict
	$(IN) python -m docs.make.offline out/site

PYTHONS ?= $(PYTHON)
dist: $(DEV)
	$(IN) .ci/dist $(PYTHONS)

# minutes for all formats together, or inputs for each; SEED=7 draws others, FORMATS=inp,bdf some of them
fuzz: $(DEV)
	$(IN) python -m benchmarks.fuzz --seed $(or $(SEED),1) $(if $(MINUTES),--minutes $(MINUTES)) \
		$(if $(COUNT),--count $(COUNT)) $(if $(FORMATS),--formats $(FORMATS))

slow: $(DEV)
	$(IN) python -m pytest -m slow

long: $(DEV)
	$(IN) python -m pytest -m long

# needs ../shared/data/independent-cases; CASES=DIR for others of the same form
independent: $(DEV)
	$(IN) python -m benchmarks.independent.table $(if $(CASES),--cases $(CASES))

# NAMES="ladder-notch ladder-mass" for some of them
a-frames: $(DEV) $(PEERS_READY)
	$(PEERS)/bin/python -m benchmarks.independent.a_frames out/a-frames $(NAMES)
	$(IN) python -m benchmarks.independent.table --cases out/a-frames --out out/a-frames-results

# frames on a shaker table, and responses over that of a sensor; NAMES="table-bay-nothing" for some of them
base-motion: $(DEV) $(PEERS_READY)
	$(PEERS)/bin/python -m benchmarks.independent.base_motion out/base-motion $(NAMES)
	$(IN) python -m benchmarks.independent.table --cases out/base-motion --out out/base-motion-results

solids: $(DEV) $(PEERS_READY)
	$(PEERS)/bin/python -m benchmarks.independent.solids out/solids $(NAMES)
	$(IN) python -m benchmarks.independent.table --cases out/solids --out out/solids-results

# each seed is a set that nobody has looked at; run once, on a program that is not changed for it
FOREIGN := out/foreign-$(or $(SEED),1)$(if $(TEST),-$(TEST))
DRAWN = --seed $(or $(SEED),1) $(if $(CASES),--cases $(CASES)) $(if $(STRUCTURES),--structures $(STRUCTURES))
JUDGED = $(if $(CAP),--cap $(CAP)) $(if $(JOBS),--jobs $(JOBS))
foreign: $(DEV) $(PEERS_READY)
	$(PEERS)/bin/python -m benchmarks.independent.foreign $(FOREIGN) $(DRAWN) $(if $(TEST),--test $(TEST))
	$(IN) python -m benchmarks.independent.table --cases $(FOREIGN) --out $(FOREIGN)-results $(JUDGED)

FOREIGN_MODES := out/foreign-modes-$(or $(SEED),1)
foreign-modes: $(DEV) $(PEERS_READY)
	$(PEERS)/bin/python -m benchmarks.independent.foreign.modes $(FOREIGN_MODES) $(DRAWN)
	$(IN) python -m benchmarks.independent.table --cases $(FOREIGN_MODES) --out $(FOREIGN_MODES)-results $(JUDGED)

extras: $(DEV) requirements-extras.lock
	@$(PIP) install --quiet -r requirements-extras.lock

# each prints its own table; docs/benchmarks.md says what they show
BENCHMARKS := assembly modes frf engine sensitivity updating modal_identification joint_speed joint_noise loading
bench: $(READY)
	$(IN) python -m benchmarks.machine
	$(IN) for name in $(BENCHMARKS); do echo "── benchmarks.$$name"; python -m benchmarks.$$name || exit 1; done

peers: $(PEERS_READY)

# points per side of the cubes; 17 has 27 700 degrees of freedom and takes minutes
bench-peers: $(READY) $(PEERS_READY)
	$(IN) python -m benchmarks.peers $(SIZES)

check: lint types contracts

lint: $(DEV)
	$(IN) ruff check
	$(IN) ruff format --check

types: $(DEV)
	$(IN) pyright

contracts: $(DEV)
	$(IN) lint-imports

format: $(DEV)
	$(IN) ruff check --fix
	$(IN) ruff format

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info; v >= (3, 11) or sys.exit("Dovetail needs Python 3.11 or newer, and $(PYTHON) is %d.%d: try make PYTHON=/path/to/python3.12" % v[:2])'
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
		echo '$(PYTHON) cannot make virtual environments: on Debian and Ubuntu, apt-get install python3-venv' >&2; exit 1; }
	@echo 'Installing what Dovetail needs into $(VENV): once, a minute or two, 900 MB'
	@test -x $(VENV)/bin/pip || $(PYTHON) -m venv --clear $(VENV)
	@$(PIP) install --quiet -r requirements.lock
	@$(PIP) install --quiet --no-deps --no-build-isolation --editable .
	@$(VENV)/bin/python -c 'import pyvista; pyvista.Plotter(off_screen=True).screenshot()' >/dev/null 2>&1 || \
		echo 'Note: 3-D pictures cannot be drawn here, for want of EGL: on Debian and Ubuntu, apt-get install libegl1 libgl1-mesa-dri' >&2
	@touch $@

$(DEV): $(READY) requirements-dev.lock
	@$(PIP) install --quiet -r requirements-dev.lock
	@touch $@

$(DOCS): $(READY) requirements-docs.lock
	@$(PIP) install --quiet -r requirements-docs.lock
	@touch $@

$(PEERS_READY): requirements-peers.lock
	@echo 'Installing OpenSeesPy, PyNite, sdypy-EMA and scikit-fem into $(PEERS): once, 500 MB'
	@test -x $(PEERS)/bin/pip || $(PYTHON) -m venv --clear $(PEERS)
	@$(PEERS)/bin/python -m pip --disable-pip-version-check install --quiet -r requirements-peers.lock
	@$(PEERS)/bin/python -c 'import openseespy.opensees, Pynite' 2>$(PEERS)/import.txt || { \
		cat $(PEERS)/import.txt >&2; echo 'OpenSeesPy or PyNite cannot be loaded: they need Linux, Python 3.11 and,' \
		'on Debian and Ubuntu, apt-get install libblas3 libquadmath0' >&2; exit 1; }
	@touch $@

# Each lock file is whole and holds the hashes of all platforms' files: requirements.lock is what running needs,
# -dev with what testing and checking need, -docs what the documentation needs, -extras the optional libraries,
# -peers the programs to compare with.
# Versions stay as they are unless pyproject.toml asks for others; make lock UPGRADE=--upgrade takes the newest.
COMPILE = .venv-lock/bin/uv pip compile --quiet --universal --no-strip-extras --generate-hashes --python-version 3.11 --no-header --no-annotate $(UPGRADE)
lock:
	test -x .venv-lock/bin/uv || $(PYTHON) -m venv .venv-lock
	.venv-lock/bin/python -m pip install --quiet uv
	echo 'setuptools>=77' | $(COMPILE) pyproject.toml - --output-file requirements.lock
	echo 'setuptools>=77' | $(COMPILE) pyproject.toml - --extra dev --constraint requirements.lock --output-file requirements-dev.lock
	echo 'setuptools>=77' | $(COMPILE) pyproject.toml - --extra dev --extra sections --extra accelerate \
		--constraint requirements-dev.lock --output-file requirements-extras.lock
	echo 'setuptools>=77' | $(COMPILE) pyproject.toml - --extra docs --constraint requirements-dev.lock --output-file requirements-docs.lock
	printf '%s\n' openseespy PyNiteFEA scipy sdypy-EMA scikit-fem \
		| $(subst --universal,--python-platform linux,$(COMPILE)) - --output-file requirements-peers.lock
	rm -rf .venv-lock

clean:
	rm -rf $(VENV) $(PEERS) .venv-lock out build dist *.egg-info .hypothesis .pytest_cache .ruff_cache .import_linter_cache .docs-cache
	find . -name __pycache__ -prune -exec rm -rf {} +
