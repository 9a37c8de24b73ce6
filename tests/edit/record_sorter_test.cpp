#include "edit/rows.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstring>

#include "base/temporary_folder.h"
#include "lamina/error.h"

namespace lamina::edit {
namespace {

struct Record {
  std::uint64_t key = 0;
  std::array<char, 5> value{};
  bool operator==(const Record&) const = default;
};

std::vector<Record> drained(RecordSorter& sorter, std::size_t batch) {
  std::vector<Record> out;
  sorter.drain(batch, [&](std::span<const std::uint64_t> keys, const std::byte* records) {
    EXPECT_LE(keys.size(), batch);
    for (std::size_t i = 0; i < keys.size(); ++i) {
      Record r{keys[i], {}};
      std::memcpy(r.value.data(), records + i * r.value.size(), r.value.size());
      out.push_back(r);
    }
  });
  return out;
}

RC_GTEST_PROP(RecordSorter, SortsStablyWhateverTheMemory, ()) {
  const test::TemporaryFolder folder;
  const auto count = *rc::gen::inRange<std::size_t>(0, 2000);
  const auto keys = *rc::gen::container<std::vector<std::uint64_t>>(count, rc::gen::inRange<std::uint64_t>(0, 300));
  std::vector<Record> records;
  for (std::size_t i = 0; i < count; ++i) {
    Record r{keys[i], {}};
    std::memcpy(r.value.data(), &i, r.value.size());
    records.push_back(r);
  }
  // A few kilobytes hold everything, one or two dozens of runs.
  RecordSorter sorter(5, *rc::gen::element<std::size_t>(0, 4000, 1 << 20), folder.path());
  const auto step = *rc::gen::inRange<std::size_t>(1, 500);
  for (std::size_t first = 0; first < count; first += step) {
    const std::size_t n = std::min(step, count - first);
    std::vector<std::byte> bytes(5 * n);
    for (std::size_t i = 0; i < n; ++i) std::memcpy(bytes.data() + 5 * i, records[first + i].value.data(), 5);
    sorter.add({keys.data() + first, n}, bytes.data());
  }
  RC_ASSERT(sorter.size() == count);
  RC_ASSERT(folder.entries() == 0);
  std::stable_sort(records.begin(), records.end(), [](const Record& a, const Record& b) { return a.key < b.key; });
  RC_ASSERT(drained(sorter, *rc::gen::inRange<std::size_t>(1, 700)) == records);
}

TEST(RecordSorter, SaysWhenThereIsNoFolder) {
  EXPECT_THROW(RecordSorter(4, 100, "/no/such/folder"), Error);
}

}  // namespace
}  // namespace lamina::edit
