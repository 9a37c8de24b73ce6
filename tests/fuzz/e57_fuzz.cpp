#include "points/formats.h"

#include "harness.h"

FUZZED(e57) {
  using namespace lamina;
  // The checksums are believed: nothing would get past them.
  return fuzz::run([&] { fuzz::read_all(*open_e57(fuzz::as_file(data, size), "fuzz", true), size); });
}
