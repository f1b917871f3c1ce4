# `make demo`, `make test` and `make lint` set everything up by themselves; nothing after that needs a network.
PYTHON ?= python3
PLATFORM ?=
LOCAL ?=
BLENDER_RUN ?=
WORKERS ?= 2
SUITE ?= quick

BIN := .venv/bin
READY := .venv/.ready
PYTEST := $(BIN)/python -m pytest
# Each worker takes neighbours, and what is left of the other's when it has done: what a file's tests share is made once.
PARALLEL := -n $(WORKERS) --dist worksteal

# As the command itself does it: the bytes of a result must not depend on the number of cores.
export OPENBLAS_NUM_THREADS := 1
# The tests start hundreds of processes. Where Python may not keep what it has compiled, each compiles the engine: 0.4 s.
unexport PYTHONDONTWRITEBYTECODE
export BLENDER_RUN

.PHONY: setup demo test test-oldest test-newest slow soak validate end-to-end lint reference docs bench extension listing package clean

setup: $(READY)

# The stamp is the last thing written. Without one, whatever lies in .venv is half a set-up and goes; with one, it is
# taken away first, so that an update that breaks off counts as half a set-up too.
$(READY): pyproject.toml setup.py blender_manifest.toml .ci/constraints.txt .ci/check_system.py
	$(PYTHON) .ci/check_system.py
	if [ -e $(READY) ]; then rm $(READY); else rm -rf .venv; fi
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --constraint .ci/constraints.txt --editable '.[dev,blender]'
	touch $(READY)

demo: setup
	$(BIN)/edf demo -o demo_output --overwrite

test: setup
	$(PYTEST) $(PARALLEL) -m "not slow and not blender"

# The add-on in the oldest Blender that is supported, as a module: 4.2 LTS, with the NumPy that it carries. rawpy asks for a
# later one and works with this, so it goes in without being asked.
OLDEST := .venv-oldest
$(OLDEST)/.ready: pyproject.toml .ci/constraints.txt
	rm -rf $(OLDEST)
	$(PYTHON) -m venv $(OLDEST)
	grep -v '^numpy' .ci/constraints.txt > $(OLDEST)/constraints.txt
	$(OLDEST)/bin/python -m pip install --quiet --constraint $(OLDEST)/constraints.txt scipy opencv-python-headless \
		poselib OpenEXR ExifRead pi-heif tqdm bpy==4.2.23 numpy==1.24.3 pytest pytest-xdist hypothesis
	$(OLDEST)/bin/python -m pip install --quiet --constraint $(OLDEST)/constraints.txt --no-deps --editable . rawpy
	touch $@

test-oldest: $(OLDEST)/.ready
	$(OLDEST)/bin/python -m pytest $(PARALLEL) tests/edf_addon tests/core/commands/test_worker.py tests/core/output/test_inspection.py

# A fast part of the tests with the newest version of every dependency, as a plain `pip install` brings it.
NEWEST := .venv-newest
$(NEWEST)/.ready: pyproject.toml
	rm -rf $(NEWEST)
	$(PYTHON) -m venv $(NEWEST)
	$(NEWEST)/bin/python -m pip install --quiet --upgrade --editable . pytest pytest-xdist hypothesis pillow-heif
	touch $@

test-newest: $(NEWEST)/.ready
	$(NEWEST)/bin/python -m pytest $(PARALLEL) -m "not slow and not blender" tests/core/pictures/test_picture.py \
		tests/core/pictures/test_heif.py tests/core/pictures/test_camera_raw.py tests/core/test_refusals.py tests/core/test_pipeline.py tests/core/pose/test_features.py tests/core/dense \
		tests/core/compose tests/core/commands/test_worker.py

# pytest exits 5 where no test is marked so.
slow: setup
	$(PYTEST) $(PARALLEL) -m "slow and not soak and not blender" || [ $$? -eq 5 ]

# What may never break, tried thousands of times: damaged files, interruptions, long sessions. Half an hour or so.
soak: setup
	$(PYTEST) $(PARALLEL) -m soak

# SUITE=full: all scenes at 1280×960, 25 minutes from empty on two cores; SUITE=sets: all sets of many pictures. Pictures
# are kept and made only once.
validate: setup
	$(BIN)/edf validate --suite $(SUITE) -o validation_$(SUITE) --overwrite

end-to-end: setup
	@[ -n "$$BLENDER_RUN" ] || { echo "say how Blender is run: make end-to-end BLENDER_RUN=blender" >&2; exit 2; }
	$(PYTEST) tests/end_to_end

# mypy takes a package's name from its folder, and a clone's folder may have any name: it gets a link with the right one.
# core is checked strictly; Blender and its add-on classes have no types that this could be done with.
lint: setup
	$(BIN)/ruff check .
	mkdir -p .venv/types && ln -sfn ../.. .venv/types/edf_stitch
	MYPYPATH=.venv/types $(BIN)/mypy --strict --follow-imports=silent --cache-dir=.mypy_cache/strict -p edf_stitch.core
	MYPYPATH=.venv/types $(BIN)/mypy -p edf_stitch.edf_addon -p edf_stitch.synthetic_scenes

# docs/reference.md and the page of `man edf`, from the program itself.
reference: setup
	$(BIN)/python .ci/reference.py
	$(BIN)/python .ci/man_page.py

# The pages as a site in build/docs. Sphinx, since it is well kept, turns what it warns of into errors, and with MyST takes the
# pages as they are: with the anchors of where the code is read.
DOCS := .venv-docs
$(DOCS)/.ready: Makefile
	rm -rf $(DOCS)
	$(PYTHON) -m venv $(DOCS)
	$(DOCS)/bin/python -m pip install --quiet sphinx==9.0.4 myst-parser==5.2.0
	touch $@

docs: $(DOCS)/.ready
	$(DOCS)/bin/sphinx-build -q -W --keep-going -b html docs build/docs

bench: setup
	$(BIN)/python tests/benchmarks/bench.py

# One zip for each platform into dist/, or PLATFORM=windows-x64 only. LOCAL=1: for this machine, with no more wheels than
# the Blender that BLENDER_RUN names needs.
extension: setup
	$(BIN)/python .ci/build_extension.py $(if $(PLATFORM),--platform $(PLATFORM)) $(if $(LOCAL),--local) \
		--blender "$$BLENDER_RUN" --output-dir dist

# Icon, featured picture and previews for the extension's page into dist/listing/.
listing: setup
	$(BIN)/python .ci/listing_pictures.py --output-dir dist/listing

# What is published: the source, the wheel built from that source alone, both as an index takes them, and the wheel tried
# in an environment of its own.
CHECKS := twine==7.0.0 check-wheel-contents==0.6.3
package:
	rm -rf dist/package build/fresh
	$(PYTHON) -m venv build/fresh
	build/fresh/bin/python -m pip install --quiet 'setuptools>=77' $(CHECKS)
	build/fresh/bin/python -c "from setuptools import build_meta; build_meta.build_sdist('dist/package')"
	build/fresh/bin/python -m pip wheel --quiet --no-deps --wheel-dir dist/package dist/package/*.tar.gz
	build/fresh/bin/twine check --strict dist/package/*
	build/fresh/bin/check-wheel-contents dist/package/*.whl
	rm -rf build/fresh
	$(PYTHON) -m venv build/fresh
	build/fresh/bin/python -m pip install --quiet --constraint .ci/constraints.txt dist/package/*.whl
	cd build/fresh && bin/edf demo --no-render --quiet -o demo && test -f share/man/man1/edf.1

clean:
	rm -rf .venv $(OLDEST) $(NEWEST) $(DOCS) build dist wheels demo_output validation_quick validation_full validation_sets *.egg-info
