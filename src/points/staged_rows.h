// The file side of writers whose rows follow a header of fixed length.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "base/output_file.h"
#include "lamina/points_writer.h"

namespace lamina {

class StagedRows {
 public:
  /// `at_once`: rows may go to a pipe as they come (their number is known, or the header does without).
  StagedRows(const std::string& path, const std::string& tmp_dir, bool at_once);

  [[nodiscard]] int fd() const { return pipe_ ? pipe_->get() : output_.fd(); }  ///< where rows go
  [[nodiscard]] const std::string& name() const { return output_.name(); }
  /// Throws Error(budget) for an errno value other than 0.
  void check(int error) const;

  /// Puts the header in its place at the beginning (a pipe that got rows at once has it already) and publishes the
  /// file, `bytes` long. Throws Error(budget).
  void publish(const std::string& header, std::uint64_t bytes);

 private:
  OutputFile output_;
  std::optional<Descriptor> pipe_;
};

/// Throws Error(internal) when another number of rows came than PointsWriterSettings::count promised.
void require_count(const std::string& name, const PointsWriterSettings& settings, std::uint64_t rows);

}  // namespace lamina
