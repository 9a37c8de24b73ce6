#include "points/formats.h"

#include "harness.h"

FUZZED(ply) {
  using namespace lamina;
  return fuzz::run([&] { fuzz::read_all(*open_ply(fuzz::as_file(data, size), "fuzz"), size); });
}
