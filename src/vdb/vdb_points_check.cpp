#include "vdb/vdb_check.h"

#include <fmt/format.h>
#include <openvdb/points/AttributeArray.h>

#include <limits>
#include <memory>
#include <set>
#include <utility>
#include <vector>

// Compressed pieces are unpacked here already: OpenVDB loses memory when it finds out in the middle of a grid.

namespace lamina::volume {
namespace {

using openvdb::points::AttributeArray;

/// An attribute's array in one leaf.
struct Array {
  std::uint64_t bytes = 0;     ///< as it lies in its page, or in the file
  std::uint64_t expected = 0;  ///< of its values
  bool uniform = false, paged = false;
};

std::uint32_t bytes_of_value(const std::string& type, const std::string& codec) {
  if (!AttributeArray::isRegistered({type, codec})) wrong(fmt::format("its points have values of type {}", type));
  return AttributeArray::create({type, codec}, 1, 1)->storageTypeSize();
}

/// Returns what a value of each attribute takes.
std::vector<std::uint32_t> check_descriptor(Walker& w) {
  std::vector<std::uint32_t> out;
  const auto count = w.number<std::uint64_t>();
  // Two empty texts each at least.
  if (count > w.left() / 8) wrong("a list of attributes does not fit into it");
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string type = w.text(), codec = w.text();
    out.push_back(bytes_of_value(type, codec));
  }
  std::set<std::uint64_t> places;
  std::set<std::string> names;
  for (std::uint64_t i = 0; i < count; ++i) {
    names.insert(w.text());
    if (const auto place = w.number<std::uint64_t>(); place < count) places.insert(place);
  }
  if (places.size() != count || names.size() != count) wrong("a list of attributes contradicts itself");
  const auto groups = w.number<std::uint64_t>();
  if (groups > w.left() / 12) wrong("a list of groups does not fit into it");
  for (std::uint64_t i = 0; i < groups; ++i) {
    w.text();
    w.skip(sizeof(std::uint64_t));
  }
  check_metadata(w);
  return out;
}

Array check_array(Walker& w, std::uint32_t value_bytes) {
  enum Written : std::uint8_t { kStrided = 1, kUniform = 2, kPaged = 8 };
  constexpr std::uint64_t kCounted = sizeof(std::int16_t) + sizeof(std::uint32_t);  // flags and size, not the values
  const auto bytes = w.number<std::uint64_t>();
  if (bytes < kCounted) wrong("an array of points is too short");
  const auto flags = w.number<std::uint8_t>();
  const auto written = w.number<std::uint8_t>();
  if (flags >= AttributeArray::PARTIALREAD || written >= 0x10) wrong("an array of points is of no known kind");
  const auto size = w.number<std::uint32_t>();
  const std::uint64_t stride = (written & kStrided) != 0 ? w.number<std::uint32_t>() : 1;
  if (size == 0 || stride == 0) wrong("an array of points is empty");
  Array out;
  out.bytes = bytes - kCounted;
  out.uniform = (written & kUniform) != 0;
  out.paged = (written & kPaged) != 0;
  const bool constant = (flags & AttributeArray::CONSTANTSTRIDE) != 0;
  // OpenVDB counts values with 32 bits. What is no stride is the number of all values.
  const std::uint64_t values = constant ? size * stride : stride;
  if (values > std::numeric_limits<std::uint32_t>::max()) wrong("an array of points is too long");
  out.expected = (out.uniform ? 1 : values) * value_bytes;
  return out;
}

struct Page {
  std::int32_t packed = 0;  ///< less than 0: not compressed
  std::int32_t bytes = 0;
};

/// Arrays of one attribute lie one behind another in pages. Reads what the pages hold; each must be used up.
std::vector<Page> check_page_sizes(Walker& w, const std::vector<std::vector<Array>>& leaves, std::size_t attribute) {
  std::vector<Page> pages;
  std::uint64_t left = 0;
  for (const std::vector<Array>& arrays : leaves) {
    if (attribute >= arrays.size() || !arrays[attribute].paged) continue;
    if (left == 0) {
      Page page;
      page.packed = w.number<std::int32_t>();
      if (page.packed == 0 || page.packed == std::numeric_limits<std::int32_t>::min())
        wrong("a page of points is empty");
      page.bytes = page.packed > 0 ? w.number<std::int32_t>() : -page.packed;
      if (page.bytes <= 0) wrong("a page of points is empty");
      pages.push_back(page);
      left = static_cast<std::uint64_t>(page.bytes);
    }
    const Array& array = arrays[attribute];
    if (array.bytes != array.expected || array.bytes > left || array.bytes == 0)
      wrong("an array of points does not fit into its page");
    left -= array.bytes;
  }
  if (left != 0) wrong("a page of points holds more than its arrays");
  return pages;
}

void check_page(Walker& w, const Page& page) {
  if (page.packed < 0) return w.skip(static_cast<std::uint64_t>(page.bytes));
  const std::uint64_t unpacked = unpack_blosc(w, static_cast<std::uint64_t>(page.packed));
  if (!holds(unpacked, static_cast<std::uint64_t>(page.bytes))) wrong("a page of points is damaged");
}

/// An array that lies in the file by itself.
void check_single(Walker& w, const Array& array) {
  if (!array.uniform && w.number<std::uint8_t>() == 1) {
    if (!holds(unpack_blosc(w, array.bytes), array.expected)) wrong("an array of points is damaged");
    return;
  }
  if (array.bytes != array.expected) wrong("an array of points has a wrong size");
  w.skip(array.bytes);
}

/// The points' offsets by voxel.
void check_voxels(Walker& w) {
  constexpr std::uint64_t kMaskBytes = 64, kVoxelBytes = 512 * sizeof(std::uint32_t);
  constexpr std::uint16_t kNotCompressed = 0xFFFF;
  w.skip(kMaskBytes);
  const auto packed = w.number<std::uint16_t>();
  if (packed == kNotCompressed) return w.skip(kVoxelBytes);
  if (unpack_blosc(w, packed) != kVoxelBytes) wrong("a leaf of points is damaged");
}

std::vector<std::vector<Array>> check_arrays(Walker& w, std::uint64_t leaves) {
  std::vector<std::vector<Array>> out;
  std::vector<std::uint32_t> value_bytes;
  bool shared = false;  // by all leaves from the first on that says so
  for (std::uint64_t leaf = 0; leaf < leaves; ++leaf) {
    if (!shared) {
      const auto header = w.number<std::uint8_t>();
      if (header > 3) wrong("a leaf of points is of no known kind");
      value_bytes = check_descriptor(w);
      shared = (header & 1U) != 0;
      if ((header & 2U) != 0) {
        const auto more = w.number<std::uint64_t>();
        if (more > w.left()) throw std::ios::failure("the end");
        w.skip(more);
      }
    }
    std::vector<Array>& arrays = out.emplace_back();
    for (const std::uint32_t bytes : value_bytes) arrays.push_back(check_array(w, bytes));
  }
  return out;
}

}  // namespace

void check_points(Walker& w, std::uint64_t leaves, std::uint32_t version) {
  constexpr std::uint32_t kPasses = 224;
  if (version < kPasses) wrong(fmt::format("it holds points in a file of version {}; save it anew", version));
  const auto passes = w.number<std::uint16_t>();
  if (passes < 4 || passes % 2 != 0) wrong("its points come in a wrong number of passes");
  const std::size_t attributes = (passes - 4U) / 2;
  w.skip(leaves * sizeof(std::uint16_t));
  const std::vector<std::vector<Array>> arrays = check_arrays(w, leaves);
  std::vector<std::vector<Page>> pages;
  for (const std::vector<Array>& leaf : arrays)
    if (leaf.size() > attributes) wrong("a leaf of points has more attributes than there are passes");
  for (std::size_t a = 0; a < attributes; ++a) pages.push_back(check_page_sizes(w, arrays, a));
  for (std::uint64_t leaf = 0; leaf < leaves; ++leaf) check_voxels(w);
  for (std::size_t a = 0; a < attributes; ++a) {
    // A page is read when its first array is wanted.
    auto page = pages[a].begin();
    std::uint64_t left = 0;
    for (const std::vector<Array>& leaf : arrays) {
      if (a >= leaf.size()) continue;
      if (!leaf[a].paged) {
        check_single(w, leaf[a]);
        continue;
      }
      if (left == 0) {
        left = static_cast<std::uint64_t>(page->bytes);
        check_page(w, *page++);
      }
      left -= leaf[a].bytes;
    }
  }
}

}  // namespace lamina::volume
