#include "normals/row_records.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <utility>

#include "normals/sample_window.h"
#include "store/block_codec.h"

namespace lamina::normals {
namespace {

/// Rows that a thread takes at a time; their normals are unpacked side by side, which is vector code.
constexpr std::size_t kSignedAtOnce = 1024;

void turn_codes(std::span<RowRecord> records, std::span<const std::uint32_t> which) {
  std::vector<NormalCode> codes(which.size());
  std::transform(which.begin(), which.end(), codes.begin(), [&](std::uint32_t i) { return records[i].code; });
  std::vector<float> n(3 * which.size());
  const std::array<float*, 3> axes{n.data(), n.data() + which.size(), n.data() + 2 * which.size()};
  unpack_codes(codes, axes);
  for (float& v : n) v = -v;
  PackedNormals packed;
  packed.resize(which.size());
  pack_normals({axes[0], axes[1], axes[2]}, which.size(), {packed.u.data(), packed.v.data(), packed.low.data()});
  for (std::size_t i = 0; i < which.size(); ++i) records[which[i]].code = {packed.u[i], packed.v[i], packed.low[i]};
}

void apply_signs_in_turn(std::span<RowRecord> records, const PatchSigns& signs) {
  std::vector<std::uint32_t> to_turn;
  for (std::uint32_t i = 0; i < records.size(); ++i) {
    RowRecord& r = records[i];
    if (r.node() == kNoNode || signs.sign[r.node()] > 0 || r.code == kNoNormal) continue;
    if (r.code == kKeep || r.code == kTurn) {
      r.code = r.code == kKeep ? kTurn : kKeep;
    } else {
      to_turn.push_back(i);
    }
  }
  turn_codes(records, to_turn);
}

}  // namespace

NormalCode code_of(const std::array<float, 3>& normal) {
  NormalCode code{};
  pack_normals({&normal[0], &normal[1], &normal[2]}, 1, {&code[0], &code[1], &code[2]});
  return code;
}

void unpack_codes(std::span<const NormalCode> codes, const std::array<float*, 3>& normals) {
  PackedNormals packed;
  packed.resize(codes.size());
  for (std::size_t i = 0; i < codes.size(); ++i) {
    packed.u[i] = codes[i][0];
    packed.v[i] = codes[i][1];
    packed.low[i] = codes[i][2];
  }
  unpack_normals({packed.u.data(), packed.v.data(), packed.low.data()}, codes.size(), normals);
}

void apply_signs(std::span<RowRecord> records, const PatchSigns& signs) {
  const tbb::blocked_range<std::size_t> all(0, records.size(), kSignedAtOnce);
  const auto each = [&](const auto& range) {
    apply_signs_in_turn(records.subspan(range.begin(), range.size()), signs);
  };
  tbb::parallel_for(all, each, tbb::simple_partitioner{});
}

RowRecords::RowRecords(std::uint64_t rows, std::size_t memory, std::string directory) : rows_(rows) {
  if (rows_ > memory / sizeof(RowRecord))
    sorter_ = std::make_unique<edit::RecordSorter>(sizeof(RowRecord), memory, std::move(directory));
}

void RowRecords::add(std::span<const std::uint64_t> rows, std::span<const RowRecord> records) {
  if (rows.empty()) return;
  if (on_disk()) {
    sorter_->add(rows, std::as_bytes(records).data());
    return;
  }
  by_row_.resize(static_cast<std::size_t>(rows_));
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rows.size(), 4096), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) by_row_[rows[i]] = records[i];
  });
}

void RowRecords::drain(std::size_t batch, const Take& take) {
  std::vector<RowRecord> records;
  sorter_->drain(batch, [&](std::span<const std::uint64_t> rows, const std::byte* bytes) {
    records.resize(rows.size());
    std::memcpy(records.data(), bytes, rows.size() * sizeof(RowRecord));
    take(rows, records);
  });
}

}  // namespace lamina::normals
