# How things are built: source lists, flags, one pattern rule a flag set, and the lint rules. Read by the Makefile.

JOBS := $(shell nproc 2>/dev/null || echo 1)

VERSION := $(shell sed -n 's/.*define TRIBEND_VERSION "\(.*\)"/\1/p' model/program/version.h)

FIRMWARE_PACKAGES := gcc-arm-none-eabi libnewlib-arm-none-eabi
EMULATOR_PACKAGES := libunicorn-dev qemu-system-arm
LCM_PACKAGES := liblcm-dev liblcm-bin
HIL_PACKAGES := user-mode-linux can-utils kmod iproute2
# npm brings the page's plotting library. Who has npm from elsewhere keeps it: Debian's would not go beside it.
VIEW_PACKAGES := libmicrohttpd-dev $(if $(shell command -v npm),,npm)
BUILD_PACKAGES := gcc libc6-dev pkg-config libgmsh-dev libsuitesparse-dev libgsl-dev libcyaml-dev libyaml-dev \
                  libopenmpi-dev openmpi-bin zlib1g-dev libjansson-dev libcmocka-dev calculix-ccx gnuplot-nox fonts-dejavu-core \
                  $(FIRMWARE_PACKAGES) $(EMULATOR_PACKAGES) $(HIL_PACKAGES) $(LCM_PACKAGES) $(VIEW_PACKAGES)
# what `make test` alone needs
TEST_PACKAGES  := chromium curl mandoc man-db bsdextrautils systemd librsvg2-bin clang python3-canmatrix
LINT_PACKAGES  := clang clang-tidy cppcheck

# --- sources: a folder is a layer; arrows between layers are include paths below
FIRMWARE_C := $(wildcard firmware/*.c firmware/*/*.c)
BOARD_C    := $(wildcard hal/stm32g4/*.c)
# what of the port has no register in it and is built for the host, too, to be tested and to replay recorded readings
PORT_PURE_C := hal/stm32g4/conversions.c hal/stm32g4/crash_record.c
# EXTRA_EFFECTS=FILE.c: effects of one's own, from anywhere, built into the simulator and the diagnosis
SIM_C      := $(wildcard hal/sim/*.c hal/sim/effects/*.c) $(EXTRA_EFFECTS)
EMULATOR_C := $(wildcard hal/emulator/*.c)
MODEL_C    := $(filter-out model/cli/%,$(wildcard model/*/*.c))
SHARED_C    := $(wildcard model/units/*.c model/program/*.c) model/description/yaml_file.c model/description/calibration_file.c
TABLES_CLI_C := $(wildcard model/cli/*.c)
HOST_C     := $(filter-out host/cli/main.c host/board/% host/manual/%,$(wildcard host/*/*.c))
MANUAL_C   := $(wildcard host/manual/*.c)
EMULATED_C := $(wildcard host/board/*.c)
HOST_MAIN  := host/cli/main.c
TEST_C     := $(wildcard tests/*/test_*.c)
BENCH_C    := $(wildcard tests/bench/bench_*.c)
CAMPAIGN_MAIN := tests/campaign/campaign_main.c
FAULTS_PAGE_C := tests/docs/faults_page.c
FUZZ_C     := $(wildcard tests/fuzz/*.c)
SUPPORT_C  := $(filter-out $(TEST_C) $(BENCH_C) $(FAULTS_PAGE_C) tests/campaign/% $(FUZZ_C),$(wildcard tests/*/*.c))
CAMPAIGN_C := $(filter-out $(TEST_C) $(CAMPAIGN_MAIN),$(wildcard tests/campaign/*.c))
SOLID_C    := $(wildcard tests/model/ccx/*.c)
INSTRUCTIONS_C := $(wildcard tests/bench/instructions/*.c)
BLIND_SCORE_C := $(wildcard tests/gap/blind/blind_score*.c)
SHARE_C := $(wildcard tests/gap/share/*.c)
UML_C := $(wildcard tests/hil/uml/*.c)
# boards for tests of the host: the firmware's node on the simulated HAL
STUB_C := $(wildcard tests/link/stub/*.c)
STUB := $(BUILD)/tests/link/stub/board_stub
BLIND_MAIN := tests/gap/blind/blind_generate.c
BLIND_C    := $(filter-out $(BLIND_SCORE_C) $(BLIND_MAIN),$(wildcard tests/gap/blind/blind_*.c))
ALL_C      := $(wildcard docs/examples/*.c) $(FIRMWARE_C) $(SIM_C) $(EMULATOR_C) $(MODEL_C) $(TABLES_CLI_C) $(HOST_C) $(HOST_MAIN) $(EMULATED_C) $(MANUAL_C) $(TEST_C) $(BENCH_C) $(SUPPORT_C) $(CAMPAIGN_C) $(CAMPAIGN_MAIN) $(FAULTS_PAGE_C) $(SOLID_C) $(BLIND_C) $(BLIND_MAIN) $(BLIND_SCORE_C) $(SHARE_C) $(INSTRUCTIONS_C) $(STUB_C) $(UML_C) $(BOARD_C)
ALL_H      := $(wildcard tests/gap/blind/*.h tests/bench/instructions/*.h tests/model/ccx/*.h firmware/*.h firmware/*/*.h hal/*.h hal/*/*.h model/*/*.h host/*/*.h tests/*/*.h)

# --- flags
WARNINGS := -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Werror
OPTIMISE := -O2 -g -fno-math-errno
# gcc 12 with the sanitizers takes a whole double[3][3] for its first row (-Wstringop-overflow)
SANITIZE_FLAGS := $(if $(filter 1,$(SANITIZE)),-fsanitize=address -fsanitize=undefined -fno-sanitize-recover=all -fno-omit-frame-pointer -Wno-stringop-overflow)
# No fused multiply-add and no reassociation anywhere: the same inputs give the same bits on every build.
EXACT := -ffp-contract=off
INCLUDES := -Ifirmware -Ihal -Imodel -Ihost -Itests
# what lcm-gen makes of host/lcm
LCM_INCLUDES := -I$(BUILD)/lcm
FIRMWARE_FLAGS := -std=c11 $(WARNINGS) -Wdouble-promotion $(EXACT) -fno-math-errno -Ifirmware -Ihal
COMMON_FLAGS   := -std=gnu11 -D_GNU_SOURCE $(WARNINGS) $(EXACT) $(INCLUDES) $(LCM_INCLUDES)
MPI_FLAGS      := $(patsubst -I%,-isystem %,$(shell pkg-config --cflags-only-I mpi-c 2>/dev/null))
MODEL_FLAGS    := $(COMMON_FLAGS) -fopenmp $(MPI_FLAGS)

# --- LCM types: code that lcm-gen makes of host/lcm/*.lcm
LCM_TYPES := $(wildcard host/lcm/*.lcm)
LCM_C     := $(patsubst host/lcm/%.lcm,$(BUILD)/lcm/%.c,$(LCM_TYPES))
LCM_O     := $(LCM_C:.c=.o)
$(LCM_C): $(BUILD)/lcm/%.c: host/lcm/%.lcm
	@mkdir -p $(@D)
	@lcm-gen -c --c-cpath $(@D) --c-hpath $(@D) $<
$(LCM_O): %.o: %.c
	$(say)$(CC) $(OPTIMISE) $(SANITIZE_FLAGS) -std=gnu11 -w -I$(@D) -c $< -o $@

# --- objects and programs
object = $(patsubst %.c,$(BUILD)/%.o,$(1))
FIRMWARE_O := $(call object,$(FIRMWARE_C))
SIM_O      := $(call object,$(SIM_C))
EMULATOR_O := $(call object,$(EMULATOR_C))
MODEL_O    := $(call object,$(MODEL_C))
SHARED_O    := $(call object,$(SHARED_C))
TABLES_CLI_O := $(call object,$(TABLES_CLI_C))
HOST_O     := $(call object,$(HOST_C)) $(BUILD)/host/view/view_files.o $(LCM_O)
EMULATED_O := $(call object,$(EMULATED_C))
SUPPORT_O  := $(call object,$(SUPPORT_C))

PROGRAMS := $(BUILD)/tribend-tables $(BUILD)/tribend $(BUILD)/tribend-board
TEST_PROGRAMS  := $(patsubst %.c,$(BUILD)/%,$(TEST_C))
BLIND_PROGRAMS := $(BUILD)/tests/gap/blind/blind_generate $(BUILD)/tests/gap/blind/blind_score $(BUILD)/tests/gap/share/gap_share
# the emulated core's own test program
SELFTEST_ELF := $(BUILD)/tests/hil/selftest.elf
BENCH_PROGRAMS := $(patsubst %.c,$(BUILD)/%,$(BENCH_C))

EMULATOR_LIBS = -lunicorn $(HOST_LIBS)
HOST_LIBS  := -llcm -lmicrohttpd -ljansson -lcyaml -lyaml -fopenmp -pthread -lm
MODEL_LIBS := $(shell pkg-config --libs mpi-c 2>/dev/null) -lgmsh -lcholmod -lgsl -lgslcblas -lcyaml -lyaml -lz -fopenmp -lm

# V=1 shows the commands in full.
say = $(if $(V),,@echo '  cc $<';)

$(BUILD)/firmware/%.o: firmware/%.c
	@mkdir -p $(@D)
	$(say)$(CC) $(OPTIMISE) $(SANITIZE_FLAGS) $(FIRMWARE_FLAGS) -MMD -MP -c $< -o $@
$(BUILD)/model/%.o: model/%.c
	@mkdir -p $(@D)
	$(say)$(CC) $(OPTIMISE) $(SANITIZE_FLAGS) $(MODEL_FLAGS) -MMD -MP -c $< -o $@
$(BUILD)/host/gap/%.o: host/gap/%.c
	@mkdir -p $(@D)
	$(say)$(CC) $(OPTIMISE) $(SANITIZE_FLAGS) $(COMMON_FLAGS) -fopenmp -MMD -MP -c $< -o $@
$(BUILD)/tests/campaign/%.o: tests/campaign/%.c
	@mkdir -p $(@D)
	$(say)$(CC) $(OPTIMISE) $(SANITIZE_FLAGS) $(COMMON_FLAGS) -fopenmp -MMD -MP -c $< -o $@
$(BUILD)/tests/gap/share/%.o: tests/gap/share/%.c
	@mkdir -p $(@D)
	$(say)$(CC) $(OPTIMISE) $(SANITIZE_FLAGS) $(MODEL_FLAGS) -MMD -MP -c $< -o $@
# whoever includes a type's header waits for it to be made
$(call object,$(wildcard host/lcm/*.c tests/host/test_bridge*.c) $(UML_C)): | $(LCM_C)
$(BUILD)/%.o: %.c
	@mkdir -p $(@D)
	$(say)$(CC) $(OPTIMISE) $(SANITIZE_FLAGS) $(COMMON_FLAGS) -MMD -MP -c $< -o $@

# --- the live view: its page is built in, with the plotting library that npm fetches as the lock file says
VIEW_PAGE  := $(wildcard host/view/page/*.html host/view/page/*.css host/view/page/*.js)
UPLOT      := $(BUILD)/view/node_modules/uplot/dist
# what was left empty for want of npm is tried again
ifneq ($(shell command -v npm),)
$(shell test -s $(UPLOT)/uPlot.iife.min.js || rm -f $(UPLOT)/uPlot.iife.min.js)
endif
$(UPLOT)/uPlot.iife.min.js: host/view/page/package.json host/view/page/package-lock.json
	@mkdir -p $(BUILD)/view && cp $^ $(BUILD)/view/
	@tests/tools/npm_packages $(BUILD)/view || { mkdir -p $(@D) && : >$@ && : >$(@D)/uPlot.min.css; \
	    echo "tribend: without npm the live view is left out, \`tribend view\` will say so; the rest is whole" >&2; }
	@touch $@
$(BUILD)/host/view/view_files.o: host/view/view_files.S $(VIEW_PAGE) $(UPLOT)/uPlot.iife.min.js
	@mkdir -p $(@D)
	$(say)$(CC) -DUPLOT_JS='"$(UPLOT)/uPlot.iife.min.js"' -DUPLOT_CSS='"$(UPLOT)/uPlot.min.css"' -c $< -o $@

link = $(if $(V),,@echo '  link $@';) $(CC) $(SANITIZE_FLAGS) $(filter %.o,$^) -o $@

$(BUILD)/tribend-tables: $(TABLES_CLI_O) $(MODEL_O) $(FIRMWARE_O)
	$(link) $(MODEL_LIBS)
$(BUILD)/tribend: $(call object,$(HOST_MAIN)) $(HOST_O) $(SIM_O) $(FIRMWARE_O) $(SHARED_O)
	$(link) $(HOST_LIBS)
# Apart from `tribend`, for libunicorn is under the GPL.
$(BUILD)/tribend-board: $(EMULATED_O) $(HOST_O) $(EMULATOR_O) $(SIM_O) $(FIRMWARE_O) $(SHARED_O)
	$(link) $(EMULATOR_LIBS)

# --- man pages and completion: a generator each, of the program's own objects, sees the option tables as they are
MANUAL_O  := $(call object,$(MANUAL_C))
MANUAL    := $(BUILD)/manual/tribend.bash $(BUILD)/manual/tribend-tables.bash
MANUAL_WRAP := -Wl,--wrap=argp_parse -Wl,--wrap=program_run -Wl,--wrap=execv
# their main() under another name, for the generator to call
$(BUILD)/manual/%_main.o: %/main.c
	@mkdir -p $(@D)
	$(say)$(CC) $(OPTIMISE) $(SANITIZE_FLAGS) $(MODEL_FLAGS) -Dmain=$(if $(filter host/board,$*),board_main,manual_main) -MMD -MP -c $< -o $@
$(BUILD)/manual/tribend.generate: $(MANUAL_O) $(BUILD)/manual/host/cli_main.o $(BUILD)/manual/host/board_main.o \
    $(filter-out %/board/main.o,$(EMULATED_O)) $(HOST_O) $(EMULATOR_O) $(SIM_O) $(FIRMWARE_O) $(SHARED_O)
	$(link) $(MANUAL_WRAP) $(EMULATOR_LIBS)
$(BUILD)/manual/tribend-tables.generate: $(MANUAL_O) $(BUILD)/manual/model/cli_main.o \
    $(filter-out %/cli/main.o,$(TABLES_CLI_O)) $(MODEL_O) $(SIM_O) $(FIRMWARE_O)
	$(link) $(MANUAL_WRAP) $(MODEL_LIBS)
$(MANUAL): %.bash: %.generate
	@$< $(@D)
-include $(wildcard $(BUILD)/manual/*/*.d)

# The firmware's pure part for an emulated core that counts instructions, by the board's own objects.
INSTRUCTIONS_O   := $(call object,$(filter-out %/image.c,$(INSTRUCTIONS_C)))
INSTRUCTIONS_ELF := $(BUILD)/tests/bench/instructions/image.elf
INSTRUCTIONS_IMAGE_O = $(patsubst %.c,$(BOARD)/%.o,$(FIRMWARE_C) tests/bench/instructions/image.c tests/bench/instructions/frame_app.c)

.PHONY: test-programs bench-programs
test-programs: $(TEST_PROGRAMS) $(MANUAL) $(BLIND_PROGRAMS) $(BUILD)/tests/campaign/campaign $(BUILD)/tests/docs/faults_page $(STUB) $(BUILD)/tests/hil/uml/mission $(SELFTEST_ELF)
bench-programs: $(BENCH_PROGRAMS)

# Tests of the model link its libraries; the others link what `tribend` links.
$(BUILD)/tests/model/test_%: $(BUILD)/tests/model/test_%.o $(SUPPORT_O) $(MODEL_O) $(FIRMWARE_O)
	$(link) -lcmocka $(MODEL_LIBS)
$(BUILD)/tests/model/test_solid $(BUILD)/tests/bench/bench_solid: $(call object,$(SOLID_C))
$(BUILD)/tests/bench/bench_model $(BUILD)/tests/bench/bench_solid: %: %.o $(MODEL_O) $(FIRMWARE_O)
	$(link) $(MODEL_LIBS)
# The blind generator has nothing of the simulator in it, the scorer nothing of anything.
$(BUILD)/tests/gap/blind/blind_generate: $(call object,$(BLIND_MAIN) $(BLIND_C)) $(FIRMWARE_O)
	$(link) -ljansson -lyaml -lm
$(BUILD)/tests/gap/blind/blind_score: $(call object,$(BLIND_SCORE_C))
	$(link) -ljansson -lm
# Steps over cores and ranks: the tables' own sweep, which needs MPI.
$(BUILD)/tests/gap/share/gap_share: $(call object,$(SHARE_C) $(wildcard model/sweep/*.c))
	$(link) $(shell pkg-config --libs mpi-c 2>/dev/null) -lz -fopenmp
$(STUB): $(call object,$(STUB_C) tests/support/sim_storage.c) $(HOST_O) $(SIM_O) $(FIRMWARE_O) $(SHARED_O)
	$(link) $(HOST_LIBS)
# a commander that has nothing of tribend but the LCM types
$(BUILD)/tests/hil/uml/mission: $(call object,$(UML_C)) $(LCM_O)
	$(link) -llcm
$(BUILD)/tests/docs/faults_page: $(call object,$(FAULTS_PAGE_C)) $(FIRMWARE_O)
	$(link) -lm
$(BUILD)/tests/campaign/test_campaign: $(call object,$(CAMPAIGN_C))
$(BUILD)/tests/campaign/campaign: $(call object,$(CAMPAIGN_MAIN) $(CAMPAIGN_C)) $(HOST_O) $(EMULATOR_O) $(SIM_O) $(FIRMWARE_O) $(SHARED_O)
	$(link) $(EMULATOR_LIBS)
$(BUILD)/tests/gap/test_blind_plant: $(call object,$(filter-out %/blind_truth.c,$(BLIND_C)))
$(BUILD)/tests/bench/test_instructions $(BUILD)/tests/bench/bench_instructions: $(INSTRUCTIONS_O) | $(INSTRUCTIONS_ELF)
$(BUILD)/tests/board/test_conversions $(BUILD)/tests/board/test_port $(BUILD)/tests/hil/test_replay: $(call object,$(PORT_PURE_C))
$(BUILD)/tests/%: $(BUILD)/tests/%.o $(SUPPORT_O) $(HOST_O) $(EMULATOR_O) $(SIM_O) $(FIRMWARE_O) $(SHARED_O)
	$(link) -lcmocka $(EMULATOR_LIBS)

$(SELFTEST_ELF): tests/hil/selftest/selftest.c tests/hil/selftest/selftest.ld
	@mkdir -p $(@D)
	$(if $(V),,@echo '  link $@';) arm-none-eabi-gcc $(ARM_CORE) -O2 -g -std=gnu11 $(WARNINGS) $(EXACT) -ffreestanding -nostdlib \
	    -T tests/hil/selftest/selftest.ld $< -o $@

.SECONDARY:
-include $(patsubst %.c,$(BUILD)/%.d,$(ALL_C))

# --- firmware for the board: the same sources and hal/stm32g4, by the ARM compiler
BOARD      := $(BUILD)/board
BOARD_O    := $(patsubst %.c,$(BOARD)/%.o,$(FIRMWARE_C) $(BOARD_C)) $(BOARD)/hal/stm32g4/table_a.o
BOARD_TABLE := tables/paper-semicircle.tbt
BOARD_CC   := arm-none-eabi-gcc
ARM_CORE   := -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16
BOARD_FLAGS := $(ARM_CORE) -O2 -g -ffunction-sections -fdata-sections -fstack-usage
BOARD_LINK := $(ARM_CORE) --specs=nano.specs -nostartfiles -T hal/stm32g4/stm32g474.ld -Wl,--gc-sections -Wl,--fatal-warnings
ELF        := $(BUILD)/firmware/tribend.elf
$(INSTRUCTIONS_ELF): $(INSTRUCTIONS_IMAGE_O) tests/bench/instructions/image.ld
	@mkdir -p $(@D)
	$(if $(V),,@echo '  link $@';) $(BOARD_CC) $(ARM_CORE) --specs=nano.specs -nostartfiles -T tests/bench/instructions/image.ld \
	    -Wl,--gc-sections -Wl,--fatal-warnings $(filter %.o,$^) -o $@

$(BOARD)/%.o: %.c
	@mkdir -p $(@D)
	$(say)$(BOARD_CC) $(BOARD_FLAGS) $(FIRMWARE_FLAGS) -MMD -MP -c $< -o $@
$(BOARD)/hal/stm32g4/table_a.o: hal/stm32g4/table_a.S $(BOARD_TABLE)
	@mkdir -p $(@D)
	$(say)$(BOARD_CC) $(ARM_CORE) -DTABLE_A_FILE='"$(BOARD_TABLE)"' -c $< -o $@
$(ELF): $(BOARD_O) hal/stm32g4/stm32g474.ld
	@mkdir -p $(@D)
	$(if $(V),,@echo '  link $@';) $(BOARD_CC) $(BOARD_LINK) -Wl,-Map=$(@:.elf=.map) $(BOARD_O) -o $@
$(ELF:.elf=.hex): $(ELF)
	@arm-none-eabi-objcopy -O ihex $< $@
# from the hex file: of the ELF, objcopy would take an empty .data in RAM for the end of the image
$(ELF:.elf=.bin): $(ELF:.elf=.hex)
	@arm-none-eabi-objcopy -I ihex -O binary --gap-fill 0xff $< $@
$(ELF:.elf=.stack): $(ELF) tests/tools/stack_usage hal/stm32g4/indirect_calls
	@tests/tools/stack_usage $< $(BOARD) hal/stm32g4/indirect_calls >$@
.PHONY: firmware-files
firmware-files: $(ELF) $(ELF:.elf=.stack) $(ELF:.elf=.hex) $(ELF:.elf=.bin)
-include $(patsubst %.c,$(BOARD)/%.d,$(FIRMWARE_C) $(BOARD_C) tests/bench/instructions/image.c tests/bench/instructions/frame_app.c)

# --- fuzz targets: libFuzzer comes with clang alone
FUZZ_FLAGS := -O2 -g -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=all
FUZZ_O     := $(patsubst %.c,$(BUILD)/fuzz/%.o,$(FIRMWARE_C) tests/support/sim_storage.c tests/support/tiny_table.c)
FUZZ_PROGRAMS := $(patsubst tests/fuzz/%.c,$(BUILD)/fuzz/%,$(filter-out tests/fuzz/seeds.c,$(FUZZ_C)))
.PHONY: fuzz-programs
fuzz-programs: $(FUZZ_PROGRAMS) $(BUILD)/fuzz/seeds
$(BUILD)/fuzz/%.o: %.c
	@mkdir -p $(@D)
	$(say)clang $(FUZZ_FLAGS) -fsanitize=fuzzer-no-link $(COMMON_FLAGS) -MMD -MP -c $< -o $@
$(FUZZ_PROGRAMS): $(BUILD)/fuzz/%: $(BUILD)/fuzz/tests/fuzz/%.o $(FUZZ_O)
	$(if $(V),,@echo '  link $@';) clang $(FUZZ_FLAGS) -fsanitize=fuzzer $(filter %.o,$^) -o $@ -lm
$(BUILD)/fuzz/seeds: $(BUILD)/fuzz/tests/fuzz/seeds.o $(FUZZ_O)
	$(if $(V),,@echo '  link $@';) clang $(FUZZ_FLAGS) $(filter %.o,$^) -o $@ -lm
-include $(wildcard $(BUILD)/fuzz/*/*.d $(BUILD)/fuzz/*/*/*.d)

# --- lint: every compiler that the firmware must build with, then the analysers
ARM_FLAGS := $(ARM_CORE) -Os
CPPCHECK_FLAGS := --enable=warning,performance,portability --inline-suppr --error-exitcode=1 --quiet \
                  --suppress=missingIncludeSystem --suppress=unknownMacro $(INCLUDES) --std=c11
HOST_SIDE_C := $(filter-out $(FIRMWARE_C) $(BOARD_C),$(ALL_C))

.PHONY: lint-all lint-firmware lint-board lint-clang lint-cppcheck lint-tidy lint-misra
lint-all: lint-firmware lint-board lint-clang lint-cppcheck lint-tidy lint-misra
	@echo "lint: clean ($(words $(ALL_C)) C files)"
lint-firmware:
	@set -e; for c in "gcc -O2" "clang -O2" "arm-none-eabi-gcc $(ARM_FLAGS)"; do for f in $(FIRMWARE_C); do \
	    $$c $(FIRMWARE_FLAGS) -c $$f -o /dev/null || { echo "lint: $$c rejects $$f"; exit 1; }; done; done
# The port has ARM assembler in it: ARM compilers alone.
BOARD_CLANG := --target=arm-none-eabi $(ARM_CORE) -isystem /usr/lib/arm-none-eabi/include
lint-board:
	@set -e; for c in "clang $(BOARD_CLANG) -O2" "arm-none-eabi-gcc $(ARM_CORE) -O2"; do for f in $(BOARD_C); do \
	    $$c $(FIRMWARE_FLAGS) -c $$f -o /dev/null || { echo "lint: $$c rejects $$f"; exit 1; }; done; done
lint-misra:
	@JOBS=$(JOBS) tests/tools/misra $(BUILD)
lint-clang: $(LCM_C)
	@printf '%s\n' $(HOST_SIDE_C) | xargs -P $(JOBS) -n 4 clang -O1 $(COMMON_FLAGS) $(MPI_FLAGS) -Wno-unknown-pragmas \
	    -Wno-source-uses-openmp -fopenmp -fsyntax-only
lint-cppcheck:
	@cppcheck -j$(JOBS) $(CPPCHECK_FLAGS) $(FIRMWARE_C) $(BOARD_C) $(SIM_C) $(EMULATOR_C) $(MODEL_C) $(TABLES_CLI_C) $(HOST_C) $(HOST_MAIN) $(EMULATED_C) $(MANUAL_C)
# one file at a time: with several, clang-tidy 14 takes every va_list for uninitialised
tidy = printf '%s\n' $(1) | xargs -P $(JOBS) -I FILE clang-tidy --quiet FILE -- $(2) 2>/dev/null
lint-tidy: $(LCM_C)
	@$(call tidy,$(FIRMWARE_C),$(FIRMWARE_FLAGS))
	@$(call tidy,$(BOARD_C),$(FIRMWARE_FLAGS) $(BOARD_CLANG))
	@$(call tidy,$(SIM_C) $(EMULATOR_C) $(MODEL_C) $(TABLES_CLI_C) $(HOST_C) $(HOST_MAIN) $(EMULATED_C) $(MANUAL_C),$(COMMON_FLAGS) $(MPI_FLAGS) \
	    -Wno-unknown-pragmas -Wno-source-uses-openmp)
