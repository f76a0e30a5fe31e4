# Everything a newcomer needs: `make demo` and `make test`. Each makes .venv when it is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-all test-arm64 compile wheels bundle deb bench budgets drive hil soak manual lint types clean help install install-program install-files uninstall fuzz siege

help:
	@echo "make demo   see the filter work on a drive that it renders itself (results in demo-out/)"
	@echo "make test   run the tests"
	@echo "make test-all   run them with Python 3.11 to 3.14;  make test-arm64   on emulated 64-bit Arm (docs/hil.md)"
	@echo "make bench  measure detection quality and speed against other methods (tables in benchmarks/results/)"
	@echo "make budgets   processor and memory of every process, beside what it may take"
	@echo "make drive  a vehicle drives through rendered worlds, by what it sees (docs/drive.md): WORLDS=12 SEED=0"
	@echo "make hil    as root: the installed daemon on a real kernel, in a virtual machine (docs/hil.md); ARCH=arm64"
	@echo "make soak   the daemon at full speed with random faults: MINUTES=60 or FRAMES=200000"
	@echo "make compile   the filter alone, after a change; demo, test and the others do it themselves"
	@echo "make wheels as root: wheels for x86-64 and 64-bit Arm, each tried, into dist/ (docs/install.md)"
	@echo "make bundle as root: archives that install without a network, into dist/ (docs/install.md)"
	@echo "make deb    as root: Debian packages that install without a network, into dist/ (docs/install.md)"
	@echo "make fuzz   attack every parser: SECONDS=60 for each (docs/fuzzing.md)"
	@echo "make siege  the daemon, its gate and its page under attack, on loopback: SECONDS=60"
	@echo "make manual the manual page and the completions, after a change of the command line"
	@echo "make lint   ruff;  make types   mypy, strict;  make clean   remove .venv and what was built"
	@echo "make install    as root: the daemon, into /opt/lcf-edge and /etc (docs/install.md);  make uninstall"

# What builds the program.
$(BIN)/cython: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "setuptools>=77" "Cython>=3.2"
	touch $@

# The filter, compiled anew when one of its files has changed. Without a compiler it stays Python, and each time tries
# again, since a compiler may have come.
SAY_COMPILED := 'from lcf_edge.compilation import uncompiled; print("lcf-edge:", uncompiled() or "the filter is compiled")'
DECLARATIONS := $(shell find lcf_edge -name '*.pxd')
$(VENV)/.compiled: setup.py lcf_edge/_compiled.c $(DECLARATIONS) $(wildcard $(DECLARATIONS:.pxd=.py)) | $(BIN)/cython
	$(BIN)/python setup.py --quiet build_ext --inplace
	$(BIN)/python -c $(SAY_COMPILED)
	if test -e lcf_edge/_compiled.abi3.so; then touch $@; fi

compile: $(VENV)/.compiled

# One stamp per set of dependencies, so that the demo does not install the test tools.
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation -e
$(VENV)/.run: pyproject.toml | $(VENV)/.compiled
	$(INSTALL) ".[plot,video,view,watch]"
	touch $@

$(VENV)/.dev: pyproject.toml | $(VENV)/.compiled
	$(INSTALL) ".[dev]"
	touch $@ $(VENV)/.run

demo: $(VENV)/.run $(VENV)/.compiled
	$(BIN)/lcf-edge demo --out demo-out

test: $(VENV)/.dev $(VENV)/.compiled
	$(BIN)/python -m pytest

# As root, where a Python is a Debian's. TESTS: what pytest is told (all, but for those of what releases the project, which
# is always done by the Python of .venv, with its pip).
RELEASE := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation -e ".[release]"
ELSEWHERE := PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m release.elsewhere
test-all: $(VENV)/.dev $(VENV)/.compiled
	$(RELEASE)
	$(ELSEWHERE) "$$(uname -m)" $(or $(PYTHONS),3.11 3.12 3.13 3.14) --tests $(or $(TESTS),--ignore tests/release)

# Not what runs the filter uncompiled or over whole drives, hours of an emulated processor: `make wheels` compares one.
ON_ARM := $(addprefix --ignore tests/lcf_edge/filter/,test_compiled.py test_replay.py) \
	$(addprefix tests/,lcf_edge/filter lcf_edge/test_cdr.py lcf_edge/test_scene_records.py lcf_edge/test_lcf_msgs.py \
	lcf_edge/test_compilation.py lcf_edge/standard_messages lcf_edge/recording drivers lcf_edge/daemon)
test-arm64: $(VENV)/.dev $(VENV)/.compiled
	$(RELEASE)
	$(ELSEWHERE) aarch64 3.13 --tests $(or $(TESTS),$(ON_ARM))

bench: $(VENV)/.dev $(VENV)/.compiled
	$(BIN)/python -m benchmarks.run $(BENCH)

budgets: $(VENV)/.dev $(VENV)/.compiled
	$(BIN)/python -m benchmarks.budgets $(BUDGETS)

drive: $(VENV)/.dev $(VENV)/.compiled
	$(BIN)/python -m benchmarks.closed_loop --worlds $(or $(WORLDS),12) --seed $(or $(SEED),0) $(DRIVE)

# As root. MACHINES=x86_64: one of the two.
wheels: $(VENV)/.dev $(VENV)/.compiled
	$(RELEASE)
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m release.wheels $(MACHINES)
	$(BIN)/twine check --strict dist/*.whl dist/*.tar.gz

bundle: wheels
	$(BIN)/python -m release.bundle $(MACHINES)

deb: wheels
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m release.deb $(MACHINES)

# As root. HIL: what pytest is told. ARCH=arm64: Debian 13 for 64-bit Arm.
hil: $(VENV)/.dev $(VENV)/.compiled
	$(RELEASE)
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m pytest hil_mocks/vm -o timeout=3600 \
		-p no:cacheprovider --durations=5 $(if $(ARCH),--arch $(ARCH) --ignore hil_mocks/vm/scenarios/test_drive.py) $(HIL)

soak: $(VENV)/.dev $(VENV)/.compiled
	$(BIN)/python -m hil_mocks.soak $(if $(FRAMES),--frames $(FRAMES),--minutes $(or $(MINUTES),10)) $(SOAK)

fuzz: $(VENV)/.dev $(VENV)/.compiled
	$(BIN)/python -m tests.fuzz --seconds $(or $(SECONDS),10) $(FUZZ)

siege: $(VENV)/.dev $(VENV)/.compiled
	$(BIN)/python -m hil_mocks.siege $(if $(SECONDS),--seconds $(SECONDS)) $(SIEGE)

manual: $(VENV)/.dev
	$(BIN)/python -m release.manual

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev
	$(BIN)/mypy

clean:
	rm -rf $(VENV) build dist demo-out lcf_edge/_compiled.*.so *.egg-info .pytest_cache .mypy_cache .ruff_cache

# The daemon, as a service of the system (docs/install.md). DESTDIR=FOLDER: into an image; FILES_ONLY=1: all but the
# program; PURGE=1: uninstall also removes configuration and recordings.
IMAGE := $(patsubst %/,%,$(abspath $(DESTDIR)))
PROGRAM := $(IMAGE)/opt/lcf-edge
COMMAND := $(IMAGE)/usr/local/bin/lcf-edge
CONFIGURATION := $(IMAGE)/etc/lcf-edge
STATE := $(IMAGE)/var/lib
UNIT := $(IMAGE)/etc/systemd/system/lcf-edge.service
INSTANCES_UNIT := $(IMAGE)/etc/systemd/system/lcf-edge@.service
GATE_UNIT := $(IMAGE)/etc/systemd/system/lcf-edge-gate.service
UDEV_RULES := $(IMAGE)/etc/udev/rules.d/70-lcf-edge.rules
GROUPS := $(IMAGE)/etc/sysusers.d/lcf-edge.conf
MODULES := $(IMAGE)/etc/modules-load.d/lcf-edge.conf
SHARE := $(IMAGE)/usr/local/share
SHARED := $(shell cd share && find . -type f)
RUNNING := test -z "$(IMAGE)" -a -d /run/systemd/system

# Built in a copy, so that nothing of root's stays in the source.
PACKED := lcf_edge drivers share pyproject.toml setup.py README.md LICENSE $(wildcard build/compiled)
COPIED := copy=$$(mktemp -d) && trap 'rm -rf "$$copy"' EXIT && cp -Rp --parents $(PACKED) "$$copy"

install: $(if $(FILES_ONLY),,install-program) install-files
	$(if $(IMAGE),,systemd-sysusers lcf-edge.conf)
	if $(RUNNING); then \
		systemctl daemon-reload; \
		systemctl restart systemd-modules-load; \
		udevadm control --reload; \
		udevadm trigger --action=add -s video4linux -s i2c-dev -s iio -s usb-serial -s tty; \
		systemctl try-restart lcf-edge 'lcf-edge@*'; \
	fi

install-program:
	test ! -e "$(IMAGE)/usr/lib/lcf-edge" || { echo "the Debian package is installed: sudo apt remove lcf-edge" >&2; exit 1; }
	test ! -L "$(PROGRAM)" || { echo "$(PROGRAM) comes from an archive: sudo $(PROGRAM)/setup remove" >&2; exit 1; }
	umask 022; $(PYTHON) -m venv "$(PROGRAM)"
	umask 022; "$(PROGRAM)/bin/python" -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	umask 022; $(if $(WHEEL),,$(COPIED) && cd "$$copy" &&) \
		"$(PROGRAM)/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps "$(or $(wildcard $(WHEEL)),$(WHEEL),.)"
	"$(PROGRAM)/bin/python" -P -c $(SAY_COMPILED)
	$(if $(IMAGE),grep -rlIF "$(IMAGE)" "$(PROGRAM)/bin" "$(PROGRAM)/pyvenv.cfg" | xargs sed -i "s|$(IMAGE)/|/|g")
	install -d "$(dir $(COMMAND))"
	ln -sfn /opt/lcf-edge/bin/lcf-edge "$(COMMAND)"

install-files:
	install -D -m 644 systemd/lcf-edge.service "$(UNIT)"
	install -D -m 644 systemd/lcf-edge@.service "$(INSTANCES_UNIT)"
	install -D -m 644 systemd/lcf-edge-gate.service "$(GATE_UNIT)"
	install -D -m 644 systemd/70-lcf-edge.rules "$(UDEV_RULES)"
	install -D -m 644 systemd/lcf-edge.sysusers "$(GROUPS)"
	install -D -m 644 systemd/lcf-edge.modules "$(MODULES)"
	test -e "$(CONFIGURATION)/config.toml" || install -D -m 644 systemd/config.toml "$(CONFIGURATION)/config.toml"
	for file in $(SHARED); do install -D -m 644 share/$$file "$(SHARE)/$$file"; done
	install -d -m 700 "$(STATE)/private"
	install -d -m 750 "$(STATE)/private/lcf-edge"
	test -e "$(STATE)/lcf-edge" || ln -s private/lcf-edge "$(STATE)/lcf-edge"

uninstall:
	if $(RUNNING) && test -e "$(UNIT)"; then systemctl disable --now lcf-edge; fi
	if $(RUNNING) && test -e "$(INSTANCES_UNIT)"; then systemctl stop 'lcf-edge@*'; systemctl disable lcf-edge@; fi
	rm -rf "$(PROGRAM)"
	if $(RUNNING) && test -e "$(GATE_UNIT)"; then systemctl disable --now lcf-edge-gate; fi
	rm -f "$(COMMAND)" "$(UNIT)" "$(INSTANCES_UNIT)" "$(GATE_UNIT)" "$(UDEV_RULES)" "$(GROUPS)" "$(MODULES)"
	for file in $(SHARED); do rm -f "$(SHARE)/$$file"; done
	if $(RUNNING); then systemctl daemon-reload; udevadm control --reload; fi
	$(if $(PURGE),rm -rf "$(CONFIGURATION)" "$(UNIT).d" "$(GATE_UNIT).d")
	$(if $(PURGE),rm -rf "$(IMAGE)/etc/systemd/system/"lcf-edge@*.service.d)
	$(if $(PURGE),rm -rf "$(STATE)/private/lcf-edge" "$(STATE)/private/"lcf-edge-* "$(STATE)/lcf-edge" "$(STATE)/"lcf-edge-*)
