#include "points/formats.h"

#include "harness.h"

FUZZED(ptx) {
  using namespace lamina;
  return fuzz::run([&] { fuzz::read_all(*open_ptx(fuzz::as_file(data, size), "fuzz"), size); });
}
