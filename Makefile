# Every target does its own set-up in .venv.
#
#   make demo          compare all schemes of both papers; report in out/compare
#   make papers        every figure and table of both papers; page in out/papers
#   make test          all tests, C and Python
#   make test-targets  the firmware on emulated processors; says which tools are missing
#   make budget        its instructions, stack and size there, into docs/budget.md
#   make bench         speed of the simulation, instructions of the firmware
#   make docs          the documentation as a site, in build/site
#   make lint          formatting and static checks
#   make format        format Python and C
#   make fuzz          fuzz the link, FUZZ_S seconds a target (clang); adds nothing to the corpus
#   make check-c       static checks of the C: warnings, 16-bit machine, cppcheck, MISRA
#   make clean         remove what the above made

VENV := .venv
BIN := $(VENV)/bin
SOURCES := $(shell find firmware host cmake -type f ! -name '*.pyc' ! -name '*.so' ! -name '*.nb?') \
  pyproject.toml CMakeLists.txt tools/setup.sh
C_SOURCES := $(shell find firmware cmake tests/c -type f) CMakeLists.txt
# All C that is written by hand: .clang-format.
C_FORMATTED := $(shell find firmware tests/c tools -name '*.[ch]' ! -name ht_tables.c ! -name vectors.h)
JOBS ?= 2
FUZZ_S ?= 120

.PHONY: help demo papers papers-quick test test-c test-targets budget sanitize fuzz bench docs lint format check-c clean
.DEFAULT_GOAL := help

help:
	@sed -n '3,14s/^# \{0,1\}//p' Makefile

$(VENV)/.installed: $(SOURCES)
	tools/setup.sh $(VENV)
	@touch $@

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

test-c: build/host/.built
	$(BIN)/ctest --preset host

# The C tests once more, under the address and undefined-behaviour sanitizers.
sanitize: $(VENV)/.installed
	$(BIN)/cmake --preset host-sanitize -G Ninja "-DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja" >/dev/null
	$(BIN)/cmake --build --preset host-sanitize
	$(BIN)/ctest --preset host-sanitize

# Finds what the corpus does not show yet. A finding is a file in out/fuzz: the program takes
# it as its argument. To keep what was learnt: fuzz_TARGET -merge=1 build/fuzz/corpus/TARGET
# out/fuzz/TARGET, for the service with -use_counters=0 besides (an input for every branch, not for
# every count), then tools/fuzz_corpus.py pack.
fuzz: $(VENV)/.installed
	$(BIN)/cmake --preset fuzz -G Ninja "-DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja" >/dev/null
	$(BIN)/cmake --build --preset fuzz --target fuzz_packet fuzz_service
	mkdir -p out/fuzz/packet out/fuzz/service
	$(BIN)/python tools/fuzz_corpus.py unpack tests/c/fuzz/corpus/packet.hex build/fuzz/corpus/packet
	$(BIN)/python tools/fuzz_corpus.py unpack tests/c/fuzz/corpus/service.hex build/fuzz/corpus/service
	build/fuzz/tests/c/fuzz/fuzz_packet -max_len=1100 -max_total_time=$(FUZZ_S) -print_final_stats=1 \
	  -artifact_prefix=out/fuzz/ out/fuzz/packet build/fuzz/corpus/packet
	build/fuzz/tests/c/fuzz/fuzz_service -max_len=300 -max_total_time=$(FUZZ_S) -print_final_stats=1 \
	  -artifact_prefix=out/fuzz/ out/fuzz/service build/fuzz/corpus/service

# These tests keep time with other processes, so they run one at a time. A busy computer can make
# one of them fail; those that fail are run once more.
TIMED := tests/host/serial tests/host/monitor tests/host/boards tests/project/test_tutorial.py
timed = $(BIN)/python -m pytest -rs $(1) || \
	$(BIN)/python -m pytest -rs --last-failed --last-failed-no-failures none $(1)

test: test-c
	$(BIN)/python -m pytest -n $(JOBS) -rs $(addprefix --ignore=,$(TIMED)) tests
	$(call timed,$(TIMED))

# One at a time: they measure speed. Fails where a tool is missing, after what can be run.
test-targets: $(VENV)/.installed
	@failed=0; \
	($(call timed,tests/host/boards)) || failed=1; \
	$(BIN)/python -m hexatorque.boards.tools || failed=1; \
	$(MAKE) check-c || failed=1; \
	exit $$failed

budget: $(VENV)/.installed
	$(BIN)/hexatorque evidence budget -o docs

bench: build/host/.built
	$(BIN)/hexatorque evidence speed --counter build/host/tests/c/count_instructions

# Strict: a link that leads nowhere fails. Without its tools, they are installed first.
docs: $(VENV)/.installed
	@$(BIN)/python -c 'import latex2mathml, material, mkdocstrings, nbclient' 2>/dev/null || \
	  HT_EXTRAS=$${HT_EXTRAS:+$$HT_EXTRAS,}docs tools/setup.sh $(VENV)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# Only the tools are needed, not what is installed: quick enough before each commit.
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

# Names a tool that is missing and how to get it.
check-c: $(VENV)/.installed
	$(BIN)/python tools/check_c.py

clean:
	rm -rf $(VENV) build out
