#include "store/slab_store.h"

namespace lamina {

void LocalSamples::clear() {
  for (auto* a : {&x, &y, &z}) a->clear();
  for (auto* a : {&nx, &ny, &nz, &radius, &quality}) a->clear();
  for (auto& a : attributes) a.clear();
}

void LocalSamples::reserve(std::size_t n) {
  for (auto* a : {&x, &y, &z}) a->reserve(n);
  for (auto* a : {&nx, &ny, &nz}) a->reserve(n);
  for (auto& a : attributes) a.reserve(n);
}

}  // namespace lamina
