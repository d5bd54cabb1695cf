# SPDX-License-Identifier: BSD-3-Clause
"""Spack package of Talus, for Spack 1.0 or newer: manual, Installation."""

import os

from spack_repo.builtin.build_systems.makefile import MakefilePackage

from spack.package import *


class Talus(MakefilePackage):
    """Concurrent discrete-element / finite-element simulation of dense granular material."""

    manual_download = True  # from a checkout: spack develop
    license("BSD-3-Clause")

    version("0.2.0")

    variant("python", default=True, description="The command talus: meshes, packings, plots")

    depends_on("c", type="build")
    depends_on("fortran", type="build")
    depends_on("gmake", type="build")
    depends_on("python@3.11:", type=("build", "run"))
    depends_on("mpi")
    depends_on("mumps@5.5:+mpi+double~int64")
    depends_on("scalapack")
    depends_on("metis@5.1:~int64~real64")
    depends_on("hypre@2.26:2+mpi~int64~mixedint~complex")
    depends_on("openblas")
    depends_on("hdf5@1.10:1.14+fortran~mpi")

    with when("+python"):
        depends_on("py-numpy", type=("build", "run"))
        depends_on("py-h5py~mpi", type=("build", "run"))
        depends_on("py-meshio", type=("build", "run"))
        depends_on("py-matplotlib", type=("build", "run"))
        depends_on("py-tqdm", type=("build", "run"))
        # its interface to files of CGNS and MED would want HDF5 with MPI
        depends_on("gmsh+shared~fltk~med~cgns", type=("build", "run"))

    requires("%fortran=gcc@12:", msg="gfortran 12 or newer compiles Talus")

    def options(self):
        """Return what differs from Debian, as words of make."""
        hdf5 = self.spec["hdf5"].prefix
        modules = os.path.dirname(find(hdf5, "hdf5.mod", recursive=True)[0])
        numerics = ("mumps", "scalapack", "metis", "openblas")
        libraries = " ".join(self.spec[name].libs.search_flags for name in numerics)
        return [
            f"PREFIX={self.prefix}",
            f"PYTHON={self.spec['python'].command.path}",
            f"FC={self.spec['mpi'].mpifc}",
            f"ARCH={self.architecture_flag()}",
            f"HDF5={self.spec['hdf5:fortran'].libs.directories[0]}",
            f"HDF5_INCLUDE={modules}",
            f"MPICC={self.spec['mpi'].mpicc}",
            f"HYPRE_INCLUDE={self.spec['hypre'].prefix.include}",
            f"LIBS_HYPRE={self.spec['hypre'].libs.search_flags} -lHYPRE",
            f"LIBS_MUMPS={libraries} -ldmumps -lmumps_common -lscalapack -lmetis -lopenblas",
        ]

    def architecture_flag(self):
        """Return the processor as gcc names it behind -march."""
        flags = self.spec.target.optimization_flags("gcc", str(self.spec["fortran"].version))
        return next((f[7:] for f in flags.split() if f.startswith("-march=")), "x86-64")

    def build(self, spec, prefix):
        make("all", *self.options())

    def install(self, spec, prefix):
        make("install", *self.options())

    def setup_run_environment(self, env):
        env.set("TALUS_PYTHON", self.spec["python"].command.path)
