#include "points/formats.h"

#include "harness.h"

FUZZED(pcd) {
  using namespace lamina;
  return fuzz::run([&] { fuzz::read_all(*open_pcd(fuzz::as_file(data, size), "fuzz", fuzz::kScratch), size); });
}
