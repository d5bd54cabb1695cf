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
MPICC  := mpicc
HDF5   ?= /usr/lib/x86_64-linux-gnu/hdf5/serial
HDF5_INCLUDE ?= /usr/include/hdf5/serial

# No loop is peeled for alignment: what a lane gives must not depend on where malloc put its array.
FFLAGS_COMMON := -std=f2018 -march=$(ARCH) -fopenmp -fno-math-errno -fno-trapping-math -Wall \
  --param vect-max-peeling-for-alignment=0 \
  -Wno-maybe-uninitialized -Wno-unused-dummy-argument -Wno-compare-reals -I/usr/include -I$(HDF5_INCLUDE)
CFLAGS_COMMON := -std=c11 -D_GNU_SOURCE -march=$(ARCH) -Wall -Wextra -Wpedantic -Wconversion
ifeq ($(MODE),debug)
  SANITIZE := -fsanitize=address,undefined -fno-omit-frame-pointer
  FFLAGS := $(FFLAGS_COMMON) -O1 -g -fcheck=all,no-array-temps -ffpe-trap=invalid,zero,overflow -fbacktrace $(SANITIZE)
  CFLAGS := $(CFLAGS_COMMON) -O1 -g $(SANITIZE)
  LDFLAGS := $(SANITIZE)
else
  FFLAGS := $(FFLAGS_COMMON) -O3 -g1
  CFLAGS := $(CFLAGS_COMMON) -O2 -g1
  LDFLAGS :=
endif
# large arrays on lines of the cache, and kept (common/base/talus_memory.c)
LDFLAGS += -Wl,--wrap=malloc,--wrap=free
LIBS_HDF5  := -L$(HDF5) -Wl,-rpath,$(HDF5) -lhdf5_fortran -lhdf5
LIBS_MUMPS := -ldmumps -lmumps_common -lscalapack-openmpi -lmetis -lopenblas
HYPRE_INCLUDE ?= /usr/include/hypre
LIBS_HYPRE := -lHYPRE

OBJ := $(BUILD)/obj
MOD := $(BUILD)/mod
BIN := $(BUILD)/bin
LIB := $(BUILD)/lib

# a part is a folder with a folder for each floor (tools/floors.txt); names of files are unique
sources   = $(sort $(wildcard $(1)/*.$(2) $(1)/*/*.$(2) $(1)/*/*/*.$(2)))
objects   = $(patsubst %.f90,$(OBJ)/%.o,$(filter-out %_main.f90,$(notdir $(call sources,$(1),f90)))) \
            $(patsubst %.c,$(OBJ)/%_c.o,$(notdir $(call sources,$(1),c)))
PROGRAMS := $(BIN)/talus-dem $(BIN)/talus-fem $(BIN)/talus-couple
# what solvers of another make link (libport/README.md)
OPEN_PORT := $(LIB)/libtalus_port.a $(LIB)/libtalus_port.so
PARTS    := common dem fem couple
UNITS    := $(patsubst %.f90,$(BUILD)/unit/%,$(filter test_%,$(notdir $(call sources,tests/unit,f90))))
HELPERS  := $(patsubst %.f90,$(OBJ)/%.o,$(filter-out test_%,$(notdir $(call sources,tests/unit,f90))))
ALL_F90  := $(foreach d,$(PARTS) tests/unit,$(call sources,$(d),f90))
vpath %.f90 $(sort $(dir $(ALL_F90)))
vpath %.c   $(sort $(dir $(foreach d,$(PARTS) libport,$(call sources,$(d),c))))

.PHONY: all common talus-dem talus-fem talus-couple open-port unit unit-one clean
all: $(PROGRAMS) $(OPEN_PORT)
open-port: $(OPEN_PORT)
talus-dem talus-fem talus-couple: %: $(BIN)/%
common: $(LIB)/libtalus_common.a
unit: $(UNITS)
unit-one: $(BUILD)/unit/$(T)
	$<

# goals that compile nothing in this make: they need no dependency scan (and no compiler yet)
NO_BUILD := clean help deps deps-apt deps-run deps-render deps-dev bench-deps keys port style test demo \
  deposit penetration element-tests overlap-column block-on-grains tyre-segment micromorphic-triaxial \
  overlap-penetration moving-window deep-cone fenicsx lammps scikit-fem calculix crushing gravity \
  verification verification-ranks manual manual-pdf bench mutants fuzz uninstall wheel

# --- version, stamped at build time --------------------------------------------------------
VERSION := $(shell cat VERSION 2>/dev/null || echo 0.0.0)
GITHASH := $(shell git describe --always --dirty 2>/dev/null || echo none)
ifneq ($(filter-out $(NO_BUILD),$(or $(MAKECMDGOALS),all)),)
$(shell tools/stamp.sh $(BUILD)/talus_build.c '$(VERSION)' '$(GITHASH)')
endif

# --- Fortran and C -------------------------------------------------------------------------
$(OBJ) $(MOD) $(BIN) $(LIB) $(BUILD)/unit:
	mkdir -p $@

$(BUILD)/depend.mk: $(ALL_F90) tools/depend.awk tools/floors.txt | $(OBJ) $(MOD)
	@awk -v obj='$$(OBJ)' -v mod='$$(MOD)' -f tools/depend.awk tools/floors.txt $(ALL_F90) > $@.tmp && mv $@.tmp $@
ifneq ($(filter-out $(NO_BUILD),$(or $(MAKECMDGOALS),all)),)
-include $(BUILD)/depend.mk
endif

# no loops worth -O3: helpers of tests, decks, and floors that only lead others (their large types
# would cost a sixth of the whole build); unit tests, which call what is optimised, take a quarter of
# the time without any
QUICK_FLOORS := common/deck common/run dem/setup dem/run dem/system dem/ranks dem/output fem/setup \
  fem/run fem/port fem/output couple/run couple/methods couple/partners couple/partition
# loops over what is on a border or changes now and then: -O3 takes twice the time of -O2 to compile
MIDDLE_FLOORS := dem/control fem/analysis fem/mesh couple/adaptive couple/facets couple/overlap \
  couple/maps
of_floors = $(foreach m,$(basename $(notdir $(foreach f,$(1),$(wildcard $(f)/*.f90)))),$(OBJ)/$(m).o)
QUICK_OBJ := $(HELPERS) $(foreach m,dem_port dem_main fem_main cpl_main dem_surface_values \
  dem_surface_store dem_state,$(OBJ)/$(m).o) $(call of_floors,$(QUICK_FLOORS))
MIDDLE_OBJ := $(call of_floors,$(MIDDLE_FLOORS))
# the steps of the default contact law become one procedure
INLINE_OBJ := $(OBJ)/dem_contact.o
flags = $(FFLAGS)$(if $(filter $(OBJ)/test_%.o,$(1)), -O0)$(if \
  $(filter $(QUICK_OBJ),$(1)), -O1 -fexpensive-optimizations)$(if \
  $(filter $(MIDDLE_OBJ),$(1)), -O2)$(if \
  $(filter $(INLINE_OBJ),$(1)), -finline-limit=4000)
$(OBJ)/%.o: %.f90 Makefile | $(OBJ) $(MOD)
	$(FC) $(call flags,$@) -J$(MOD) -c -o $@ $<
$(OBJ)/%_c.o: %.c Makefile | $(OBJ)
	$(CC) $(CFLAGS) -c -o $@ $<
$(OBJ)/talus_port_shm_c.o: common/port/talus_port_shm.h
# mpi.h: by the compiler of MPI that belongs to $(FC)
$(OBJ)/fem_hypre_c.o: CC := $(MPICC)
$(OBJ)/fem_hypre_c.o: CFLAGS += -isystem $(HYPRE_INCLUDE)
# written with the object, its time kept where nothing in it has changed: only a change is passed on
$(MOD)/%.mod:
	@test -f $@

define library_rules
$(LIB)/libtalus_$(1).a: $(call objects,$(1)) | $(LIB)
	rm -f $$@ && ar rcs $$@ $$^
endef
$(foreach d,$(PARTS),$(eval $(call library_rules,$(d))))
$(LIB)/libtalus_common.a: $(OBJ)/talus_build_c.o
$(OBJ)/talus_build_c.o: $(BUILD)/talus_build.c | $(OBJ)
	$(CC) $(CFLAGS) -c -o $@ $<

$(BIN)/talus-dem: $(OBJ)/dem_main.o $(LIB)/libtalus_dem.a $(LIB)/libtalus_common.a | $(BIN)
	$(FC) -fopenmp $(LDFLAGS) -o $@ $^ $(LIBS_HDF5)
$(BIN)/talus-fem: $(OBJ)/fem_main.o $(LIB)/libtalus_fem.a $(LIB)/libtalus_common.a | $(BIN)
	$(FC) -fopenmp $(LDFLAGS) -o $@ $^ $(LIBS_MUMPS) $(LIBS_HYPRE) $(LIBS_HDF5)
$(BIN)/talus-couple: $(OBJ)/cpl_main.o $(LIB)/libtalus_couple.a $(LIB)/libtalus_common.a | $(BIN)
	gfortran -fopenmp $(LDFLAGS) -o $@ $^ -lopenblas $(LIBS_HDF5)

# without sanitizers, which a foreign program has not
PIC_OBJ := $(patsubst %.c,$(OBJ)/pic/%.o,$(notdir $(wildcard libport/*.c)) talus_port_shm.c talus_partner.c \
  talus_crc64.c talus_hash.c)
$(OBJ)/pic/%.o: %.c libport/talus_port.h libport/port_parts.h common/port/talus_port_names.h \
  common/port/talus_port_shm.h Makefile
	@mkdir -p $(@D)
	$(CC) $(CFLAGS_COMMON) -O2 -g1 -fPIC -fvisibility=hidden -Ilibport -Icommon/port -c -o $@ $<
$(LIB)/libtalus_port.a: $(PIC_OBJ) | $(LIB)
	rm -f $@ && ar rcs $@ $^
$(LIB)/libtalus_port.so: $(PIC_OBJ) | $(LIB)
	$(CC) -shared -Wl,-soname,libtalus_port.so -Wl,-z,defs -o $@ $^ -lpthread -lrt

# unit tests link what they may use, and of what they share what they need; a folder without
# sources yields an empty library
$(LIB)/libtalus_unit.a: $(HELPERS) | $(LIB)
	rm -f $@ && ar rcs $@ $^
unit_libs = $(LIB)/libtalus_$(1).a $(LIB)/libtalus_common.a
GOLD := $(if $(shell command -v ld.gold),-fuse-ld=gold)  # links them in a third of the time
define unit_rule
$(BUILD)/unit/$(1): $(OBJ)/$(1).o $(LIB)/libtalus_unit.a \
  $(if $(filter test_dem_%,$(1)),$(LIB)/libtalus_dem.a) $(if $(filter test_fem_%,$(1)),$(LIB)/libtalus_fem.a) \
  $(if $(filter test_cpl_%,$(1)),$(LIB)/libtalus_couple.a) $(LIB)/libtalus_common.a | $(BUILD)/unit
	$(if $(filter test_fem_% test_dem_%,$(1)),$(FC),gfortran) -fopenmp $(LDFLAGS) $(GOLD) -o $$@ $$^ \
	  $(if $(filter test_fem_%,$(1)),$(LIBS_MUMPS) $(LIBS_HYPRE)) $(if $(filter test_cpl_%,$(1)),-lopenblas) $(LIBS_HDF5)
endef
$(foreach t,$(notdir $(UNITS)),$(eval $(call unit_rule,$(t))))

# --- what a user calls ---------------------------------------------------------------------
.PHONY: help deps deps-apt deps-run deps-render deps-dev keys port test demo deposit penetration element-tests \
  overlap-column block-on-grains tyre-segment micromorphic-triaxial overlap-penetration \
  moving-window deep-cone fenicsx lammps scikit-fem calculix crushing gravity \
  bench bench-deps verification verification-ranks manual manual-pdf mutants style install uninstall tarball wheel
PY := $(VENV)/bin/python

help:
	@printf '%s\n' \
	  'make               build talus-dem, talus-fem, talus-couple into $(BUILD)/bin' \
	  'make demo          set up, build, run the coupled penetration and a cone in sand, name their figures' \
	  'make test          set up, build, run every test and the quick verification cases' \
	  'make verification  all verification cases (CASE=id for one)' \
	  'make fuzz          long campaigns of changed decks, damaged files, kills (SEED=n)' \
	  'make verification-ranks  those of grains and coupled ones, grains, then solids on RANKS=2 ranks' \
	  'make manual        the manual as HTML in build/manual' \
	  'make manual-pdf    the same as one PDF, by chromium (CHROMIUM=program)' \
	  'make penetration   three containers and the sweep of moduli (hours)' \
	  'make deposit       remake the shipped deposit and compare (CONTAINER=medium|large|wide: another)' \
	  'make element-tests isotropic, K0, drained and undrained tests of ellipsoids, five seeds' \
	  'make overlap-column  a wave from grains through an overlap into continuum (a minute)' \
	  'make block-on-grains, make tyre-segment  soft bodies on free grains (minutes)' \
	  'make micromorphic-triaxial  an element and a specimen of a micromorphic sand (minutes)' \
	  'make overlap-penetration  a core of grains in a continuum beside all grains (an hour)' \
	  'make moving-window  a bar in a bed that wakes before it, beside the whole bed (15 minutes)' \
	  'make deep-cone      a cone in a bed that wakes around it, beside the whole bed (an hour)' \
	  'make fenicsx       a solid of FEniCSx in the place of talus-fem (minutes)' \
	  'make lammps        grains of LAMMPS in the place of talus-dem (a minute)' \
	  'make scikit-fem    a solid of scikit-fem in the place of talus-fem (minutes)' \
	  'make calculix      the matrix of CalculiX in the place of talus-fem (minutes)' \
	  'make gravity       a tool in a bed under gravity: grains, overlap, rigid box (three minutes)' \
	  'make crushing      breaking spheres in an oedometer (two minutes)' \
	  'make bench         speed beside other codes (make bench-deps; CASES=..., QUICK=1, ACCEPT=1)' \
	  'make deps          what all this needs (deps-run: batch nodes, deps-render: pictures)' \
	  'make style         layout rules of the code' \
	  'make mutants       one-line faults: which test notices each (half an hour; ACCEPT=1 keeps the report)' \
	  'make install PREFIX=/usr/local (DESTDIR=folder in front of it), make uninstall' \
	  'make tarball       what make install installs, with its libraries, to be unpacked anywhere' \
	  'make wheel         the Python package for pip' \
	  'options: MODE=debug  ARCH=native|x86-64-v3|...  BUILD=folder'

deps: deps-apt deps-run deps-render deps-dev
deps-apt:
	@tools/deps.sh apt
deps-run deps-render deps-dev: deps-%: deps-apt
	@tools/deps.sh $*
deps-render deps-dev: deps-run

# sub-makes see the compilers that deps has just installed
test: deps
	@$(MAKE) --no-print-directory all unit
	$(PY) tools/test_all.py --bin $(BIN) --units $(BUILD)/unit

demo: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/demo.sh build/demo

deposit: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/01-penetration/run.sh deposit build/deposit$(if $(CONTAINER),_$(CONTAINER)) $(CONTAINER)

penetration: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/01-penetration/run.sh $@ build/$@

element-tests: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/02-element-tests/run.sh build/$@

overlap-column: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/03-overlap-column/run.sh build/$@

block-on-grains: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/04-block-on-grains/run.sh build/$@

tyre-segment: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/05-tyre-segment/run.sh build/$@

micromorphic-triaxial: deps-run
	@$(MAKE) --no-print-directory all
	examples/06-micromorphic-triaxial/run.sh build/$@

moving-window: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/08-moving-window/run.sh build/$@

deep-cone: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/19-deep-cone/run.sh build/$@

fenicsx: deps-run
	@$(MAKE) --no-print-directory all
	examples/14-fenicsx/run.sh build/$@

lammps: deps-run
	@$(MAKE) --no-print-directory all
	examples/15-lammps/run.sh build/$@

scikit-fem: deps-run
	@$(MAKE) --no-print-directory all
	examples/16-scikit-fem/run.sh build/$@-run

calculix: deps-run
	@$(MAKE) --no-print-directory all
	examples/17-calculix/run.sh build/$@

gravity: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/18-gravity-penetration/run.sh build/$@

crushing: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/13-crushing/run.sh build/$@

overlap-penetration: deps-run deps-render
	@$(MAKE) --no-print-directory all
	examples/07-overlap-penetration/run.sh build/$@

verification: deps
	@$(MAKE) --no-print-directory all
	$(PY) tools/verify.py --bin $(BIN) --out build/verification $(if $(CASE),--case $(CASE))

verification-ranks: deps
	@$(MAKE) --no-print-directory all
	$(PY) tools/verify.py --bin $(BIN) --out build/verification_ranks --area dem couple \
	  --ranks $(or $(RANKS),2) $(if $(CASE),--case $(CASE))
	$(PY) tools/verify.py --bin $(BIN) --out build/verification_solid_ranks --area couple \
	  --solid-ranks $(or $(RANKS),2) $(if $(CASE),--case $(CASE))

manual: deps-run deps-dev
	$(PY) tools/manual.py --out build/manual
manual-pdf: deps-run deps-dev
	$(if $(CHROMIUM),CHROMIUM='$(CHROMIUM)') $(PY) tools/manual_pdf.py --out build/manual

bench-deps: deps-apt
	@tools/deps.sh bench

bench: deps-run
	@$(MAKE) --no-print-directory all
	$(PY) tools/bench.py --bin $(BIN) --out build/bench $(if $(CASES),--cases $(CASES)) \
	  $(if $(REPEATS),--repeats $(REPEATS)) $(if $(QUICK),--quick) $(if $(ACCEPT),--accept)

keys: deps-run
	$(PY) tools/keys.py

mutants: deps
	@$(MAKE) --no-print-directory all unit
	$(PY) tools/mutants.py --out build/mutants $(if $(ONLY),--only $(ONLY)) $(if $(ACCEPT),--accept)

fuzz: deps
	@$(MAKE) --no-print-directory all
	@for program in decks files texts port signals; do \
	  PYTHONPATH=prepost $(PY) tests/fuzz/$$program.py --bin=$(BIN) --long --seed=$(or $(SEED),1) || exit 1; \
	done

port: deps-run
	$(PY) tools/port.py

style: deps-run deps-dev
	$(PY) tools/style.py

# man pages and completion come from the environment of `make deps-run`, where it is there
INSTALL := PYTHON=$(firstword $(wildcard $(PY)) $(PYTHON)) tools/install.sh
TARBALL ?= $(BUILD)/talus-$(VERSION)-$(shell uname -m).tar.gz
install: all
	$(INSTALL) install $(DESTDIR)$(PREFIX) $(BIN) $(LIB)
uninstall:
	$(INSTALL) uninstall $(DESTDIR)$(PREFIX)
tarball: all
	$(INSTALL) tarball $(TARBALL) $(BIN) $(LIB)
wheel:
	$(PYTHON) tools/wheel.py $(BUILD)/wheel

clean:
	rm -rf $(BUILD)/obj $(BUILD)/mod $(BUILD)/bin $(BUILD)/lib $(BUILD)/unit $(BUILD)/depend.mk \
	  $(BUILD)/talus_build.c
