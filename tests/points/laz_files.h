// Pairs of LAS and LAZ files of the same records.
#pragma once
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "base/temporary_folder.h"
#include "lamina/points.h"
#include "laz/chunks.h"
#include "points/formats.h"
#include "points/las.h"
#include "support/paths.h"

namespace lamina::test {

inline const std::string kLazFolder = LAMINA_SOURCE_DIR "/tests/points/laz/";

/// Names of pairs NAME.las and NAME.laz: point format, x extra bytes, c scanner channels, v the coder's version.
inline constexpr std::array kPairs{"f0", "f3_x3", "f6_c4", "f7_x3", "f8_c4_x2", "f8_c4_x2_v4"};

inline std::string las_of(const std::string& name) {
  const std::string las = name.ends_with("_v4") ? name.substr(0, name.size() - 3) : name;
  return kLazFolder + las + ".las";
}

inline std::string laz_bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// A file and the records in it.
struct Opened {
  explicit Opened(const std::string& path, const PointSelection& selection = {})
      : file(open_input(path, {})), header(read_las_header(file)), records(open_las_records(file, header, selection)) {}

  [[nodiscard]] std::string read(std::uint64_t first, std::size_t count, const laz::WantedBytes& wanted = {}) const {
    std::string bytes(count * header.record_bytes, '\0');
    records->read({first, count}, wanted, [&](const std::byte* from, std::size_t at, std::size_t n) {
      std::memcpy(bytes.data() + at * header.record_bytes, from, n * header.record_bytes);
    });
    return bytes;
  }
  [[nodiscard]] std::string all() const { return read(0, static_cast<std::size_t>(records->count())); }

  InputFile file;
  LasHeader header;
  std::unique_ptr<LasRecords> records;
};

class LazFolder : public ::testing::Test {
 protected:
  std::string write(const std::string& bytes) const { return write_file(folder_ / "cloud.laz", bytes); }
  TemporaryFolder folder_;
};

}  // namespace lamina::test
