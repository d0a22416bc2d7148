# Everything runs from .venv, which the targets make and keep up to date by themselves.

PYTHON ?= python3
MINUTES ?= 10
WALKS ?= 1000
CALLS ?= 100000
MUTANTS ?= 200
MATRIX ?= noble trixie newest
SEED ?= 0
SEEDS ?= 1 2 3 4 5
# Kinds of processors whose rounding the random calls run with, as far as this one has their instructions.
CORETYPES ?= Nehalem Sandybridge Haswell
PLANT ?= elastic
SENSORS ?= perfect
VENV := .venv
# .noble has Ubuntu 24.04's versions of the Python packages, and only what package.xml declares; Ubuntu's
# Matplotlib, 3.6.3, has no wheel for Python 3.12: it is 3.7.3.
NOBLE_PYTHON ?= $(shell tools/find_python.sh 3.12 '$(PYTHON)')
NOBLE = VENV=.noble PYTHON='$(NOBLE_PYTHON)' KINDS=test
# Kinds of packages that tests need beyond requirements.txt, each a file requirements-KIND.txt.
KINDS := test view mujoco extra
BIN := $(VENV)/bin
STAMPS := $(VENV)/stamps
# Sets the environment up with more kinds of packages. Messages are generated while packages are installed; of
# two targets that make the same environment side by side, one waits for the other.
setup = @mkdir -p '$(VENV)' && flock '$(VENV)' $(MAKE) --silent --no-print-directory $(if $(findstring jobserver,$(MAKEFLAGS)),,-j2) \
	$(STAMPS)/messages $(STAMPS)/package $(addprefix $(STAMPS)/kind-,$(1))
# Share of the random examples of the properties; all of them run where pytest is called by hand.
export EXAMPLES_SHARE ?= 0.1
PYTEST := $(BIN)/python -m pytest -n auto --dist worksteal

# Tests and demo keep to this machine; each locks a domain of its own there.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
unexport ROS_DOMAIN_ID

# A ROS installation that is sourced would mix its packages and settings with those of .venv.
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONHOME PYTHONPATH
unexport RMW_IMPLEMENTATION ROS_DISCOVERY_SERVER ROS_LOCALHOST_ONLY ROS_STATIC_PEERS
unexport FASTRTPS_DEFAULT_PROFILES_FILE FASTDDS_DEFAULT_PROFILES_FILE
# Without bytecode, every process of the tests would compile all modules anew.
unexport PYTHONDONTWRITEBYTECODE
# Set by the wheels' start-up hook once it has set the library path, of whichever environment it ran in.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

.PHONY: help venv test wheel noble matrix nightly demo view paper plant docs colcon bench fuzz calls mutants measure soak neighbours coverage \
	format clean
.PHONY: demo-venv types-and-pictures unit-tests system-tests long-tests session docs-venv noble-venv noble-some noble-all plant-some FORCE

help:
	@echo 'make demo     move a grasped object with the real nodes; draws a picture and an animation; PLANT=mujoco, SENSORS=real'
	@echo 'make view     watch and drag the robot in a browser; PLANT=elastic, kinematic or mujoco, ROBOT=mine.yaml, OBJECT=box.yaml'
	@echo 'make test     style, types and tests; those of ament run with make colcon'
	@echo 'make wheel    build the wheel, install it into an empty environment, and run the Python of README.md there'
	@echo 'make noble    some tests with the versions of Ubuntu 24.04, in .noble'
	@echo 'make matrix   tests without ROS with the versions of Ubuntu 24.04, of Debian 13, and the newest, in .matrix'
	@echo 'make nightly  long checks within an hour: all tests, demo and paper as in make noble; matrix, neighbours, a session in Chromium,'
	@echo '              soak, calls, mutants, some of plant, demos; states the time of each'
	@echo 'make paper    compute and draw the figures of the paper: docs/paper.md'
	@echo 'make plant    compare our model with MuJoCo: docs/plant.md'
	@echo 'make pictures draw the outdated pictures and films of README and site again'
	@echo 'make docs     build the documentation site: docs/_build/html/index.html'
	@echo 'make colcon   build and test both packages as a colcon workspace, in .colcon'
	@echo 'make bench    run the benchmarks'
	@echo 'make fuzz     fuzz the readers of files, MINUTES=10 each (x86-64)'
	@echo 'make calls    CALLS=100000 random calls of the core'
	@echo 'make mutants MUTANTS=200 small faults in loop, holding and gate, of which the tests must notice 92 %; SEED=0'
	@echo 'make measure  report sizes, structure, calls and tests beside those of the last release; STORE=VERSION'
	@echo 'make soak     run the nodes at 1 kHz for MINUTES=15, WALKS=1000 walks at the edge of the shapes'
	@echo 'make neighbours run the system tests in random orders, SEEDS="1 2 3 4 5", beside the other tests'
	@echo 'make coverage run the tests and list lines and branches of the core that no test runs'
	@echo 'make format   format the sources and fix what can be fixed'
	@echo 'make venv     only set up .venv'
	@echo 'make clean    remove .venv and all build results'
	@echo 'Each target sets up .venv; for another version of Python: make PYTHON=python3.12 ...'

# All that tests need.
venv:
	+$(call setup,$(KINDS))

# All that the demonstration, or what runs it in MuJoCo, needs.
demo-venv:
	+$(call setup,$(if $(filter mujoco,$(PLANT)),mujoco))

# Types and pictures, checked by one process each, are checked beside the unit tests.
test: venv
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	+$(MAKE) --no-print-directory -j2 types-and-pictures unit-tests
	+$(MAKE) --no-print-directory system-tests
	@command -v chromium > /dev/null || echo 'Skipped: test_the_object_follows_its_handle_and_a_stop_ends_it needs Chromium: sudo apt install chromium'

types-and-pictures: venv
	$(BIN)/mypy
	$(BIN)/python tools/pictures.py --check

unit-tests: venv
	$(PYTEST) -m 'not linter and not nightly' --ignore test/system

# After the others: they go by the clock of the machine. They wait more than they compute.
system-tests: venv
	$(PYTEST) -n 3 --dist loadgroup -m 'not nightly' test/system

wheel: venv
	tools/check_wheel.sh $(VENV)

noble:
	+$(MAKE) noble-some $(NOBLE)

# Runs another target, and states the time of it, whether it succeeds or not.
timed = begin=$$(date +%s); $(MAKE) $(1); status=$$?; \
	echo "nightly: $(1): $$(($$(date +%s) - begin)) s"; exit $$status

# Within an hour on two cores. The versions of .noble run the daily tests, those of .venv the long ones.
# Each run of pytest lists its slowest thirty tests.
nightly: export PYTEST_ADDOPTS = --durations=30
nightly: venv
	+@$(call timed,demo-venv VENV=.by_pip INSTALLER=pip)
	+@$(call timed,noble-all $(NOBLE))
	+@$(call timed,matrix MATRIX=newest EXAMPLES_SHARE=0.02)
	+@$(call timed,neighbours SEEDS=1)
	+@$(call timed,long-tests)
	+@$(call timed,session)
	+@$(call timed,soak MINUTES=3 WALKS=60)
	+@$(call timed,calls CALLS=12000)
	+@$(call timed,mutants MUTANTS=40)
	+@$(call timed,plant-some)
	+@$(call timed,measure)
	+@$(call timed,demo SENSORS=real)
	+@$(call timed,demo PLANT=mujoco)
	+@$(call timed,demo PLANT=mujoco SENSORS=real)

SESSION := test/system/test_browser_session.py

# The picks, which wait more than they compute, begin first, as the largest group.
long-tests: venv
	$(PYTEST) -n 3 --dist loadgroup -m nightly --ignore $(SESSION)

# Ten minutes in Chromium, and a view of MuJoCo, beside nothing else: both go by the clock.
session: venv
	@command -v chromium > /dev/null || { echo 'session: no chromium found: apt-get install chromium'; exit 1; }
	$(BIN)/python -m pytest -m nightly $(SESSION)

# What other versions of NumPy, SciPy, MuJoCo and the readers of files can change.
matrix:
	set -e; for versions in $(MATRIX); do tools/version_matrix.sh $$versions .matrix \
		$(addprefix test/, core/numerics core/model core/statics core/contact core/holding core/manipulation \
		core/estimation core/servo core/recording mujoco_plant programs/test_plotting.py); done

noble-venv:
	+$(MAKE) venv $(NOBLE)

# What runs into other versions: solvers, files, messages, drawing. By night all daily tests do, and the demo.
# What random examples prove does not depend on the versions: a few of them do.
noble-some: export EXAMPLES_SHARE = 0.02
noble-some: venv
	$(PYTEST) -m 'not system and not nightly' $(addprefix test/, core/numerics core/model core/statics \
		core/contact nodes/inputs/test_object_messages.py nodes/framework/test_parameters.py \
		nodes/grasp/test_grasp_analysis_node.py nodes/motion/test_manipulation_node.py \
		nodes/simulator/test_simulator_node.py calibration/test_fit.py programs/test_plotting.py)

noble-all: venv
	$(PYTEST) -m 'not system and not linter and not nightly'
	$(PYTEST) --dist loadgroup -m 'system and not nightly'
	$(BIN)/python -m isotruss_ros.demo --output $(VENV)/demo
	$(BIN)/python -m studies.paper --output $(VENV)/paper

demo: demo-venv
	$(BIN)/python -m isotruss_ros.demo --plant $(PLANT) --sensors $(SENSORS)

view:
	+$(call setup,view $(if $(filter mujoco,$(PLANT)),mujoco))
	$(BIN)/python -m isotruss_ros.demo.view --plant $(PLANT) $(if $(ROBOT),--robot '$(ROBOT)') \
		$(if $(OBJECT),--object '$(OBJECT)')

paper: venv
	$(BIN)/python -m studies.paper

plant: venv
	$(BIN)/python -m studies.comparison

# Some cases of each comparison, with the same bounds; the page stays as it is.
plant-some: venv
	$(BIN)/python -m studies.comparison --some

# By what they show and what draws them; the films need Chromium and EGL, that in MuJoCo a machine that does
# nothing else.
pictures: venv
	$(BIN)/python tools/pictures.py

docs-venv:
	+$(call setup,$(KINDS) docs)

docs: docs-venv
	rm -rf docs/_build docs/api
	$(BIN)/python docs/_ext/committed_pages.py
	$(BIN)/python -m sphinx -n -W --keep-going -q docs docs/_build/html
	$(BIN)/python docs/_ext/check_links.py docs/_build/html

colcon:
	+$(call setup,$(KINDS) colcon)
	tools/colcon.sh $(VENV) .colcon

bench: venv
	$(BIN)/python -m studies.benchmarks

fuzz:
	+$(call setup,$(KINDS) fuzz)
	tools/fuzz/run.sh $(BIN)/python $(MINUTES)

soak: MINUTES = 15
soak: venv
	PYTHONPATH=test/helpers $(BIN)/python tools/soak.py --minutes $(MINUTES)
	WALKS=$(WALKS) $(PYTEST) test/core/safety/test_walks.py -k other

# Seeds of random orders; a failure ends the other tests as well.
neighbours: venv
	@set -e; for seed in $(SEEDS); do \
		$(MAKE) --no-print-directory unit-tests >$(VENV)/neighbour.log 2>&1 & other=$$!; \
		trap "kill $$other 2>/dev/null || :" EXIT; \
		SHUFFLE=$$seed $(MAKE) --no-print-directory system-tests; \
		wait $$other || { tail -n 40 $(VENV)/neighbour.log; exit 1; }; \
	done

calls: venv
	set -e; first=0; for kind in $(CORETYPES); do \
		OPENBLAS_CORETYPE=$$kind FIRST_CALL=$$first CALLS=$$(($(CALLS) / $(words $(CORETYPES)))) \
			$(PYTEST) test/core/test_random_calls.py; first=$$((first + $(CALLS))); done

mutants:
	+$(call setup,$(KINDS) mutants)
	$(BIN)/python tools/mutants.py --count $(MUTANTS) --seed $(SEED)

# A report; no test bounds its figures.
measure: venv
	$(BIN)/python tools/measure.py $(if $(STORE),--store $(STORE))

coverage: venv
	EXAMPLES_SHARE=1 $(PYTEST) -m 'not system and not linter and not nightly' --cov=isotruss_ros.core --cov-branch \
		--cov-report=term-missing:skip-covered

format: venv
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf .venv .noble .by_pip .matrix .mutants docs/_build docs/api .colcon build install log *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis

# The script leaves the stamp alone while the same Python serves the same folder.
$(STAMPS)/python: FORCE
	@tools/make_venv.sh '$(PYTHON)' $(VENV)

$(STAMPS)/packages: $(STAMPS)/python requirements.txt tools/make_venv.sh tools/install_packages.sh \
		tools/python_headers.sh tools/relocate_wheels.py
	@tools/install_packages.sh $(VENV) requirements.txt
	@tools/python_headers.sh $(VENV)
	@$(BIN)/python tools/relocate_wheels.py
	@touch $@

# The script builds messages again only if their content is another.
$(STAMPS)/messages: $(STAMPS)/packages tools/build_messages.sh tools/type_supports.cmake $(shell find msg_defs)
	@tools/build_messages.sh $(VENV)
	@touch $@

$(STAMPS)/package: $(STAMPS)/packages setup.py setup.cfg package.xml
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps \
		--no-build-isolation --use-pep517 --editable .
	@touch $@

$(STAMPS)/kind-%: requirements-%.txt $(STAMPS)/packages | $(STAMPS)/package
	@tools/install_packages.sh $(VENV) $<
	@touch $@

# One after the other, because they install into the same environment; none after one that fails.
chain = $(if $(word 2,$(1)),$(eval $(word 2,$(1)): | $(word 1,$(1)))$(call chain,$(wordlist 2,$(words $(1)),$(1))))
$(call chain,$(filter $(STAMPS)/kind-%,$(MAKECMDGOALS)))
