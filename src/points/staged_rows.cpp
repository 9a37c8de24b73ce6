#include "points/staged_rows.h"

#include <fmt/format.h>

#include "lamina/error.h"

namespace lamina {

StagedRows::StagedRows(const std::string& path, const std::string& tmp_dir, bool at_once) : output_(path, tmp_dir) {
  if (output_.streams() && at_once) pipe_.emplace(output_.destination());
}

void StagedRows::check(int error) const {
  if (error != 0) report_write_error(output_.name(), error);
}

void StagedRows::publish(const std::string& header, std::uint64_t bytes) {
  if (pipe_) return check(pipe_->close());
  check(pwrite_all(output_.fd(), header.data(), header.size(), 0));
  if (!output_.streams()) return output_.publish();
  Descriptor to = output_.destination();
  check(copy_all(output_.fd(), bytes, to.get()));
  check(to.close());
}

void require_count(const std::string& name, const PointsWriterSettings& settings, std::uint64_t rows) {
  if (!settings.count || *settings.count == rows) return;
  throw Error(ExitCode::internal, fmt::format("{}: {} rows came, {} were announced", name, rows, *settings.count));
}

}  // namespace lamina
