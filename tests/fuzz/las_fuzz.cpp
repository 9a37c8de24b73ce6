#include "points/formats.h"

#include "harness.h"

FUZZED(las) {
  using namespace lamina;
  return fuzz::run([&] { fuzz::read_all(*open_las(fuzz::as_file(data, size), "fuzz"), size); });
}
