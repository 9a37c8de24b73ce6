#include "points/formats.h"

#include "harness.h"

FUZZED(laz) {
  using namespace lamina;
  constexpr std::size_t kDenser = 4;  // points that are all alike take less than anything else
  return fuzz::run([&] { fuzz::read_all(*open_las(fuzz::as_file(data, size), "fuzz"), kDenser * size); });
}
