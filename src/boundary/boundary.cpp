#include "boundary/boundary.h"

#include <cstring>
#include <type_traits>

#include "lamina/error.h"

namespace lamina::boundary {
namespace {

template <class T>
void put(const std::vector<T>& values, std::vector<std::byte>& out) {
  static_assert(std::is_trivially_copyable_v<T>);
  const std::uint64_t count = values.size();
  const auto append = [&](const void* data, std::size_t bytes) {
    const auto* from = static_cast<const std::byte*>(data);
    out.insert(out.end(), from, from + bytes);
  };
  append(&count, sizeof count);
  append(values.data(), values.size() * sizeof(T));
}

template <class T>
void get(std::span<const std::byte>& left, std::vector<T>& values) {
  const auto require = [](bool ok) {
    if (!ok) throw Error(ExitCode::unreadable, "the boundary of a part is damaged; make the chunk again");
  };
  std::uint64_t count = 0;
  require(left.size() >= sizeof count);
  std::memcpy(&count, left.data(), sizeof count);
  left = left.subspan(sizeof count);
  require(count <= left.size() / sizeof(T));
  const std::size_t before = values.size();
  values.resize(before + count);
  if (count > 0) std::memcpy(values.data() + before, left.data(), count * sizeof(T));
  left = left.subspan(count * sizeof(T));
}

}  // namespace

void pack(const BoundaryBatch& batch, std::vector<std::byte>& out) {
  put(batch.vertices, out);
  put(batch.attributes, out);
  put(batch.inner, out);
  put(batch.edges, out);
  put(batch.loose, out);
}

BoundaryBatch unpack(std::span<const std::byte> bytes) {
  BoundaryBatch batch;
  while (!bytes.empty()) {
    get(bytes, batch.vertices);
    get(bytes, batch.attributes);
    get(bytes, batch.inner);
    get(bytes, batch.edges);
    get(bytes, batch.loose);
  }
  return batch;
}

}  // namespace lamina::boundary
