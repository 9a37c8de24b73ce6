// What a finished store consists of; shared by the writer that makes it and the store that reads it.
#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "slab_store/block_codec.h"
#include "slab_store/columns.h"
#include "slab_store/temp_file.h"

namespace lamina {

struct BucketIndex {
  std::vector<BlockEntry> blocks;  ///< in the order of append()
  std::uint64_t count = 0;
  std::int32_t z_lower = std::numeric_limits<std::int32_t>::max();
  std::int32_t z_upper = std::numeric_limits<std::int32_t>::min();
};

struct SlabStore::Impl {
  SampleColumns columns;
  StoreLayout layout;
  TempFile file;
  std::vector<BucketIndex> buckets;
  std::uint64_t total = 0;
};

}  // namespace lamina
