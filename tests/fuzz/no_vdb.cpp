// OpenVDB reads its own files, and is not what is looked at here.
#include "lamina/error.h"
#include "points/formats.h"

namespace lamina {

std::unique_ptr<PointSource> open_vdb(const std::string& path) {
  throw Error(ExitCode::unreadable, path + ": not under the fuzzer");
}

}  // namespace lamina
