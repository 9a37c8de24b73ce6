// Lists of scans, and poses.
#include <cmath>

#include "harness.h"

FUZZED(inputs) {
  using namespace lamina;
  const InputFile file = fuzz::as_file(data, size);
  const std::string path = "/proc/self/fd/" + std::to_string(file.file.get());
  fuzz::run([&] { expand_inputs({"cloud.ply@" + path}); });
  return fuzz::run([&] {
    const std::vector<PointInput> inputs = expand_inputs({path});
    if (inputs.empty()) fuzz::broken("no inputs");
    for (const PointInput& input : inputs) {
      if (input.posed && !(std::abs(input.pose[0][0]) <= 1.0001)) fuzz::broken("no rotation");
    }
  });
}
