#include "normals/row_normals.h"

#include <cmath>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "lamina/error.h"
#include "normals/sample_window.h"
#include "points/filters.h"
#include "store/block_codec.h"

namespace lamina::normals {
namespace {

constexpr std::size_t kRowsAtOnce = std::size_t{1} << 15;

std::array<float, 3> normal_of(const NormalCode& code) {
  std::array<float, 3> n{};
  unpack_normals({&code[0], &code[1], &code[2]}, 1, {&n[0], &n[1], &n[2]});
  return n;
}

NormalCode turned(const NormalCode& code) {
  if (code == kKeep) return kTurn;
  if (code == kTurn) return kKeep;
  if (code == kNoNormal) return code;
  const std::array<float, 3> n = normal_of(code);
  return code_of({-n[0], -n[1], -n[2]});
}

RowRecord record_at(const std::byte* bytes) {
  RowRecord r{};
  std::memcpy(r.code.data(), bytes, sizeof(NormalCode));
  std::memcpy(&r.node, bytes + sizeof(NormalCode), sizeof r.node);
  return r;
}

class WithRowNormals final : public WithNormals {
 public:
  WithRowNormals(std::unique_ptr<PointSource> source, std::unique_ptr<RowNormals> normals)
      : WithNormals(std::move(source)), normals_(std::move(normals)) {}

 private:
  void give_normals(SampleBatch& rows) const override { normals_->apply(rows); }

  std::unique_ptr<RowNormals> normals_;
};

}  // namespace

NormalCode code_of(const std::array<float, 3>& normal) {
  NormalCode code{};
  pack_normals({&normal[0], &normal[1], &normal[2]}, 1, {&code[0], &code[1], &code[2]});
  return code;
}

RowNormals::RowNormals(edit::RecordSorter& records, const PatchSigns& signs, std::uint64_t rows,
                       const std::string& directory, const RunContext& run)
    : file_(directory) {
  BackgroundWriter writer(SpillFile::kBufferBytes, 4);
  std::vector<NormalCode> codes;
  std::uint64_t next = 0;
  const auto write = [&] {
    file_.append(std::as_bytes(std::span(codes)), writer);
    next += codes.size();
    codes.clear();
  };
  const auto skip_to = [&](std::uint64_t row) {
    while (next + codes.size() < row) {
      codes.push_back(kKeep);
      if (codes.size() == kRowsAtOnce) write();
    }
  };
  records.drain(kRowsAtOnce, [&](std::span<const std::uint64_t> keys, const std::byte* bytes) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    for (std::size_t i = 0; i < keys.size(); ++i) {
      skip_to(keys[i]);
      const RowRecord r = record_at(bytes + i * kRecordBytes);
      codes.push_back(r.node != kNoNode && signs.sign[r.node] < 0 ? turned(r.code) : r.code);
      if (codes.size() == kRowsAtOnce) write();
    }
    if (run.progress) run.progress({"signs", next, rows, 0, 0});
  });
  skip_to(rows);
  write();
  file_.flush(writer);
  file_.check(writer.drain());
}

void RowNormals::apply(SampleBatch& batch) const {
  const std::size_t n = batch.size();
  std::vector<NormalCode> codes(n);
  if (n > 0) file_.read(batch.first * sizeof(NormalCode), std::as_writable_bytes(std::span(codes)));
  const bool has = !batch.nx.empty();
  for (auto* axis : {&batch.nx, &batch.ny, &batch.nz}) axis->resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::array<float, 3> normal{};
    const bool own = codes[i] == kKeep || codes[i] == kTurn;
    if (own && has) {
      normal = {batch.nx[i], batch.ny[i], batch.nz[i]};
      const bool finite = std::isfinite(normal[0]) && std::isfinite(normal[1]) && std::isfinite(normal[2]);
      if (!finite) normal = {};
      if (codes[i] == kTurn) normal = {-normal[0], -normal[1], -normal[2]};
    } else if (!own && codes[i] != kNoNormal) {
      normal = normal_of(codes[i]);
    }
    batch.nx[i] = normal[0];
    batch.ny[i] = normal[1];
    batch.nz[i] = normal[2];
  }
}

std::unique_ptr<PointSource> give_normals(std::unique_ptr<PointSource> source, std::unique_ptr<RowNormals> normals) {
  return std::make_unique<WithRowNormals>(std::move(source), std::move(normals));
}

}  // namespace lamina::normals
