#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <system_error>

#include "lamina/error.h"
#include "lamina/view.h"

namespace lamina {

std::string find_viewer() {
  namespace fs = std::filesystem;
  std::error_code failed;
  const fs::path folder = fs::read_symlink("/proc/self/exe", failed).parent_path();
  for (const fs::path& share : {folder / "share", folder.parent_path() / "share"}) {
    const fs::path file = share / "lamina" / "viewer.js";
    if (fs::is_regular_file(file, failed)) return file.string();
  }
  throw Error(ExitCode::usage,
              fmt::format("the viewer's code, share/lamina/viewer.js, is not beside the program in {}; 'scripts/setup "
                          "viewer' in Lamina's sources makes it (npm), building installs it",
                          folder.string()));
}

}  // namespace lamina
