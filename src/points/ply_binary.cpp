#include "points/ply_binary.h"

#include <algorithm>

#include "points/binary_rows.h"
#include "points/ply_walk.h"

namespace lamina {
namespace {

class BinaryPly final : public PointSource {
 public:
  BinaryPly(InputFile file, const PlyHeader& header, PlyRows rows)
      : file_(std::move(file)),
        columns_(std::move(rows.columns)),
        layout_{locate_element(file_, header, rows.element), rows.stride, is_swapped(header.format)} {
    info_ = std::move(rows.info);
    info_.random_access = true;
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    first = std::min(first, info_.count);
    count = static_cast<std::size_t>(std::min<std::uint64_t>(count, info_.count - first));
    const std::vector<ColumnTarget> targets = prepare_batch(info_, columns_, first, count, out);
    read_binary_rows(file_, layout_, columns_, first, count, targets);
    round_exact_attributes(out);
  }

 private:
  InputFile file_;
  std::vector<PointColumn> columns_;
  BinaryRows layout_;
};

}  // namespace

std::unique_ptr<PointSource> open_binary_ply(InputFile file, const PlyHeader& header, PlyRows rows) {
  return std::make_unique<BinaryPly>(std::move(file), header, std::move(rows));
}

}  // namespace lamina
