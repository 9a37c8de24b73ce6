#include "points/las_points.h"

#include "harness.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace lamina;
  return fuzz::run([&] { fuzz::read_all(*open_las(fuzz::as_file(data, size), "fuzz"), size); });
}
