// Every input of the fuzzers' corpus once more, in the build under test: what was found stays mended.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <ostream>
#include <set>
#include <string>
#include <vector>

#include "fuzzed_readers.h"
#include "support/paths.h"

namespace lamina::fuzz {
namespace {

struct Reader {
  const char* name;
  int (*run)(const std::uint8_t* data, std::size_t size);
};

constexpr std::array kReaders = {
    Reader{"e57", fuzz_e57},           Reader{"file", fuzz_file},         Reader{"inputs", fuzz_inputs},
    Reader{"las", fuzz_las},           Reader{"laz", fuzz_laz},           Reader{"mesh_obj", fuzz_mesh_obj},
    Reader{"mesh_glb", fuzz_mesh_glb}, Reader{"mesh_off", fuzz_mesh_off}, Reader{"mesh_ply", fuzz_mesh_ply},
    Reader{"mesh_stl", fuzz_mesh_stl}, Reader{"obj", fuzz_obj},           Reader{"pcd", fuzz_pcd},
    Reader{"ply", fuzz_ply},           Reader{"ptx", fuzz_ptx},           Reader{"text", fuzz_text},
    Reader{"vdb", fuzz_vdb},
};

std::filesystem::path corpus() {
  return std::filesystem::path(LAMINA_SOURCE_DIR) / "tests/fuzz/corpus";
}

std::vector<std::uint8_t> bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

class Replay : public testing::TestWithParam<Reader> {};

TEST_P(Replay, CorpusIsReadOrRefused) {
  int inputs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(corpus() / GetParam().name)) {
    SCOPED_TRACE(entry.path().filename());
    const std::vector<std::uint8_t> bytes = bytes_of(entry.path());
    EXPECT_NO_THROW(GetParam().run(bytes.data(), bytes.size()));
    ++inputs;
  }
  EXPECT_GT(inputs, 0);
}

INSTANTIATE_TEST_SUITE_P(Fuzzed, Replay, testing::ValuesIn(kReaders),
                         [](const auto& reader) { return std::string(reader.param.name); });

TEST(ReplayList, KnowsEveryFolderOfTheCorpus) {
  std::set<std::string> known, there;
  for (const Reader& reader : kReaders) known.insert(reader.name);
  for (const auto& entry : std::filesystem::directory_iterator(corpus())) there.insert(entry.path().filename());
  EXPECT_EQ(known, there);
}

}  // namespace
}  // namespace lamina::fuzz
