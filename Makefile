# tribend's entry points; `make help` lists them. The rules behind them are in the parts below, in reading order.
#
#   BUILD=dir     put everything that is built into dir (default build, or build-sanitize)
#   SANITIZE=1    build with the address and undefined-behaviour sanitizers
#   CC=clang      another compiler
#   EXTRA_EFFECTS=FILE.c   effects of your own, built into simulator and diagnosis

SANITIZE ?= 0
BUILD    ?= $(if $(filter 1,$(SANITIZE)),build-sanitize,build)
PREFIX   ?= /usr/local
CC       := $(if $(filter default,$(origin CC)),gcc,$(CC))
SHELL    := /bin/bash
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
MAKEFLAGS += --no-builtin-rules
include tests/tools/build.mk

.PHONY: help setup all demo test bench gap-check firmware flash misra hil campaign docs docs-faults docs-messages fuzz lint format tables install uninstall clean

help: ## list these targets
	@grep -hE '^[a-z-]+:.*## ' Makefile | awk -F ':.*## ' '{printf "  make %-10s %s\n", $$1, $$2}'

setup: ## install the Debian packages that are missing (root or sudo; else prints the apt line)
	@tests/tools/setup $(BUILD_PACKAGES)

all: $(PROGRAMS) $(MANUAL) ## build the programs: tribend-tables and tribend

demo: setup ## from the material to a bent tip, with pictures (sets up what is missing first)
	@$(MAKE) --no-print-directory -j$(JOBS) all
	@tests/tools/demo $(BUILD)

test: setup ## build and run every test (sets up what is missing first)
	@tests/tools/setup $(TEST_PACKAGES)
	@$(MAKE) --no-print-directory -j$(JOBS) all test-programs firmware-files
	@tests/tools/run_tests $(BUILD)

bench: setup ## time equilibrium, table, simulation, diagnosis and emulated board, count instructions (PART=gap: one part)
	@$(MAKE) --no-print-directory -j$(JOBS) all bench-programs firmware-files
	@tests/tools/bench $(BUILD)

gap-check: setup ## blind check of the diagnosis: data of another plant, truth withheld (FULL=1: four times as many; MPI_RANKS=n)
	@$(MAKE) --no-print-directory -j$(JOBS) all test-programs
	@tests/gap/blind/gap_check

firmware: ## build what is flashed (ELF, hex, bin, map in BUILD/firmware) and hold flash, RAM and stack to their bounds
	@tests/tools/setup $(FIRMWARE_PACKAGES)
	@$(MAKE) --no-print-directory -j$(JOBS) firmware-files
	@tests/tools/firmware_report $(ELF)

flash: firmware ## put it on a NUCLEO-G474RE with openocd, st-flash or dfu-util (TOOL=one of them)
	@tests/tools/flash $(ELF:.elf=)

misra: ## MISRA C:2012 over the firmware and the board's port; docs/misra.md has the deviations
	@tests/tools/setup cppcheck
	@JOBS=$(JOBS) tests/tools/misra $(BUILD)

hil: setup ## the flashed ELF on the emulated board: in virtual time, then on real CAN sockets inside user-mode Linux
	@$(MAKE) --no-print-directory -j$(JOBS) all test-programs firmware-files
	@tests/tools/run_tests $(BUILD) hil

campaign: setup ## break the simulated board in every way, alone and in pairs, and a sample on the emulated one (MISSIONS=n EMULATED=n SEED=n FAULT=text CSV=file)
	@$(MAKE) --no-print-directory -j$(JOBS) $(BUILD)/tests/campaign/campaign firmware-files
	@$(BUILD)/tests/campaign/campaign $(if $(MISSIONS),-n $(MISSIONS)) $(if $(SEED),-s $(SEED)) $(if $(FAULT),-f '$(FAULT)') \
	    -e $(or $(EMULATED),60) -E $(ELF) -o $(if $(CSV),$(CSV),$(BUILD)/campaign.csv)

docs: all ## check the documentation: links, subcommands, headers, drawings, the commands of its pages
	@tests/tools/setup $(TEST_PACKAGES)
	@TRIBEND_BUILD=$(BUILD) bash tests/docs/test_docs.sh

docs-messages: $(BUILD)/tribend ## write docs/messages.md and docs/tribend.dbc from firmware/comms/messages.def
	@$(BUILD)/tribend dbc --page -o docs/messages.md
	@$(BUILD)/tribend dbc -o docs/tribend.dbc

SECONDS ?= 600
fuzz: setup ## fuzz frames, tip stream, tables and parameters (SECONDS=600 each; TARGET=frames: one of them)
	@tests/tools/setup clang
	@$(MAKE) --no-print-directory -j$(JOBS) fuzz-programs
	@tests/fuzz/run $(BUILD) $(SECONDS) $(TARGET)

docs-faults: $(BUILD)/tests/docs/faults_page ## write docs/faults.md from firmware/safety/faults.def
	@$(BUILD)/tests/docs/faults_page >docs/faults.md

lint: ## warnings as errors with gcc, clang and the ARM compiler; cppcheck; clang-tidy
	@tests/tools/setup $(BUILD_PACKAGES) $(LINT_PACKAGES)
	@$(MAKE) --no-print-directory -k -j$(JOBS) lint-all

format: ## clang-format every C file
	@clang-format -i $(ALL_C) $(ALL_H)

tables: $(BUILD)/tribend-tables ## rebuild the reference table tables/paper-semicircle.tbt from its module and material
	$(BUILD)/tribend-tables build tables/modules/paper-semicircle.yaml -o tables/paper-semicircle.tbt

install: all firmware-files ## install below PREFIX (default /usr/local), staged below DESTDIR
	@tests/tools/install_tree install $(BUILD) $(VERSION) '$(DESTDIR)' '$(PREFIX)'

uninstall: ## take away what `make install` put there
	@tests/tools/install_tree uninstall '$(DESTDIR)' '$(PREFIX)'

clean: ## remove what was built
	rm -rf build build-sanitize $(BUILD)
