// Files of any format, with gzip and the telling of formats before.
#include "harness.h"

FUZZED(file) {
  using namespace lamina;
  const InputFile file = fuzz::as_file(data, size);
  const std::string path = "/proc/self/fd/" + std::to_string(file.file.get());
  return fuzz::run([&] {
    constexpr std::size_t kGzipRatio = 1032;
    fuzz::read_all(*open_points(path, PointSettings{fuzz::kScratch, {}}), kGzipRatio * size);
  });
}
