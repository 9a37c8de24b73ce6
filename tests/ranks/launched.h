// The program started by mpirun.
#pragma once
#include <string>
#include <vector>

#include "support/program.h"

namespace lamina::test {

/// Open MPI keeps some of its memory to the end, and containers forbid it to copy between processes with one call. Runs
/// side by side make the one folder that they would share at the same time, and one of them fails: each has its own.
inline const std::string kMpiEnvironment =
    "export ASAN_OPTIONS=detect_leaks=0:$ASAN_OPTIONS OMPI_MCA_btl_vader_single_copy_mechanism=none "
    "OMPI_MCA_orte_tmpdir_base=$(mktemp -d /tmp/ranks-XXXXXX); trap 'rm -rf \"$OMPI_MCA_orte_tmpdir_base\"' EXIT; ";

/// Why ranks cannot be tried here; empty: they can.
inline std::string no_ranks() {
  if (run_shell("mpirun --version").code != 0) return "there is no mpirun";
  const Outcome tried = run_shell(
      kMpiEnvironment + "OMPI_COMM_WORLD_SIZE=2 OMPI_COMM_WORLD_RANK=0 lamina surface none.ply -o none_mesh.ply");
  return tried.err.find("without MPI") != std::string::npos ? "the program was built without MPI" : "";
}

/// mpirun with `ranks` processes, as many as there are processors or more.
inline std::string mpirun(int ranks) {
  return kMpiEnvironment + "mpirun --allow-run-as-root --oversubscribe --bind-to none -np " + std::to_string(ranks) +
         " " + quoted(LAMINA_PROGRAM);
}

inline Outcome run_ranks(int ranks, const std::vector<std::string>& arguments) {
  std::string command = mpirun(ranks);
  for (const std::string& argument : arguments) command += " " + quoted(argument);
  return run_shell(command);
}

}  // namespace lamina::test
