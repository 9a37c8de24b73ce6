#include "points/formats.h"

#include "harness.h"

FUZZED(obj) {
  using namespace lamina;
  return fuzz::run([&] { fuzz::read_all(*open_obj(fuzz::as_file(data, size), "fuzz"), size); });
}
