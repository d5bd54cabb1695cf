# Talus: one makefile for everything. `make` builds; `make demo`, `make test` do all the set-up.
SHELL := /bin/bash
.DELETE_ON_ERROR:
.SUFFIXES:

MODE   ?= release
BUILD  ?= $(if $(filter debug,$(MODE)),build/debug,build)
PREFIX ?= /usr/local
ARCH   ?= native
PYTHON ?= $(firstword $(wildcard /usr/bin/python3) python3)
VENV   ?= build/venv
TALUS  := $(VENV)/bin/talus

FC     := mpifort
CC     := gcc
HDF5   ?= /usr/lib/x86_64-linux-gnu/hdf5/serial
HDF5_INCLUDE ?= /usr/include/hdf5/serial

FFLAGS_COMMON := -std=f2018 -march=$(ARCH) -fopenmp -fno-math-errno -fno-trapping-math -Wall \
  -Wno-maybe-uninitialized -Wno-unused-dummy-argument -Wno-compare-reals -I/usr/include -I$(HDF5_INCLUDE)
CFLAGS_COMMON := -std=c11 -D_GNU_SOURCE -march=$(ARCH) -Wall -Wextra -Wpedantic -Wconversion
ifeq ($(MODE),debug)
  SANITIZE := -fsanitize=address,undefined -fno-omit-frame-pointer
  FFLAGS := $(FFLAGS_COMMON) -O1 -g -fcheck=all -ffpe-trap=invalid,zero,overflow -fbacktrace $(SANITIZE)
  CFLAGS := $(CFLAGS_COMMON) -O1 -g $(SANITIZE)
  LDFLAGS := $(SANITIZE)
else
  FFLAGS := $(FFLAGS_COMMON) -O3 -g1
  CFLAGS := $(CFLAGS_COMMON) -O2 -g1
  LDFLAGS :=
endif
LIBS_HDF5  := -L$(HDF5) -Wl,-rpath,$(HDF5) -lhdf5_fortran -lhdf5
LIBS_MUMPS := -ldmumps -lmumps_common -lscalapack-openmpi -lmetis -lopenblas

OBJ := $(BUILD)/obj
MOD := $(BUILD)/mod
BIN := $(BUILD)/bin
LIB := $(BUILD)/lib

sources = $(sort $(wildcard $(1)/*.f90))
objects = $(patsubst %.f90,$(OBJ)/%.o,$(subst /,-,$(filter-out %_main.f90,$(call sources,$(1))))) \
          $(patsubst %.c,$(OBJ)/%_c.o,$(subst /,-,$(sort $(wildcard $(1)/*.c))))
PROGRAMS  := $(BIN)/talus-dem $(BIN)/talus-fem $(BIN)/talus-couple
UNITS     := $(patsubst tests/unit/%.f90,$(BUILD)/unit/%,$(filter-out tests/unit/talus_test.f90,$(call sources,tests/unit)))
ALL_F90   := $(foreach d,common dem fem couple tests/unit,$(call sources,$(d)))

.PHONY: all common talus-dem talus-fem talus-couple unit unit-one clean
all: $(PROGRAMS)
talus-dem talus-fem talus-couple: %: $(BIN)/%
common: $(LIB)/libtalus_common.a
unit: $(UNITS)
unit-one: $(BUILD)/unit/$(T)
	$<

# --- version, stamped at build time --------------------------------------------------------
VERSION := $(shell cat VERSION 2>/dev/null || echo 0.0.0)
GITHASH := $(shell git describe --always --dirty 2>/dev/null || echo none)

# --- Fortran and C -------------------------------------------------------------------------
$(OBJ) $(MOD) $(BIN) $(LIB) $(BUILD)/unit:
	mkdir -p $@

$(BUILD)/depend.mk: $(ALL_F90) tools/depend.awk | $(OBJ) $(MOD)
	awk -v obj='$$(OBJ)' -f tools/depend.awk $(ALL_F90) > $@.tmp && mv $@.tmp $@
ifeq ($(filter clean deps deps-run deps-render keys style help,$(MAKECMDGOALS)),)
-include $(BUILD)/depend.mk
endif

define folder_rules
$(OBJ)/$(subst /,-,$(1))-%.o: $(1)/%.f90 Makefile | $(OBJ) $(MOD)
	$$(FC) $$(FFLAGS) -J$$(MOD) -c -o $$@ $$<
$(OBJ)/$(subst /,-,$(1))-%_c.o: $(1)/%.c $(wildcard $(1)/*.h) Makefile | $(OBJ)
	$$(CC) $$(CFLAGS) -c -o $$@ $$<
endef
$(foreach d,common dem fem couple tests/unit,$(eval $(call folder_rules,$(d))))

define library_rules
$(LIB)/libtalus_$(1).a: $(call objects,$(1)) | $(LIB)
	rm -f $$@ && ar rcs $$@ $$^
endef
$(foreach d,common dem fem couple,$(eval $(call library_rules,$(d))))

$(BIN)/talus-dem: $(OBJ)/dem-dem_main.o $(LIB)/libtalus_dem.a $(LIB)/libtalus_common.a | $(BIN)
	gfortran -fopenmp $(LDFLAGS) -o $@ $^ $(LIBS_HDF5)
$(BIN)/talus-fem: $(OBJ)/fem-fem_main.o $(LIB)/libtalus_fem.a $(LIB)/libtalus_common.a | $(BIN)
	$(FC) -fopenmp $(LDFLAGS) -o $@ $^ $(LIBS_MUMPS) $(LIBS_HDF5)
$(BIN)/talus-couple: $(OBJ)/couple-cpl_main.o $(LIB)/libtalus_couple.a $(LIB)/libtalus_common.a | $(BIN)
	gfortran -fopenmp $(LDFLAGS) -o $@ $^ $(LIBS_HDF5)

# unit tests link what they may use; a folder without sources yields an empty library
unit_libs = $(LIB)/libtalus_$(1).a $(LIB)/libtalus_common.a
define unit_rule
$(BUILD)/unit/$(1): $(OBJ)/tests-unit-$(1).o $(OBJ)/tests-unit-talus_test.o \
  $(if $(filter test_dem_%,$(1)),$(LIB)/libtalus_dem.a) $(if $(filter test_fem_%,$(1)),$(LIB)/libtalus_fem.a) \
  $(if $(filter test_cpl_%,$(1)),$(LIB)/libtalus_couple.a) $(LIB)/libtalus_common.a | $(BUILD)/unit
	$(if $(filter test_fem_%,$(1)),$(FC),gfortran) -fopenmp $(LDFLAGS) -o $$@ $$^ \
	  $(if $(filter test_fem_%,$(1)),$(LIBS_MUMPS)) $(LIBS_HDF5)
endef
$(foreach t,$(notdir $(UNITS)),$(eval $(call unit_rule,$(t))))

clean:
	rm -rf $(BUILD)/obj $(BUILD)/mod $(BUILD)/bin $(BUILD)/lib $(BUILD)/unit $(BUILD)/depend.mk
