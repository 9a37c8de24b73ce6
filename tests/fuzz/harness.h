// What the fuzzers share: bytes as a file, and what must hold for any of them.
#pragma once
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>

#include "base/descriptor.h"
#include "fuzzed_readers.h"
#include "lamina/error.h"
#include "lamina/points.h"
#include "points/input_file.h"

// Begins the function that hands `size` bytes at `data` to a reader: libFuzzer's entry where each reader has a program
// of its own, a function with the reader's name where one program replays the corpus of all (replay_test.cpp).
#ifdef LAMINA_FUZZ_ENTRY
#define FUZZED(reader) extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
#else
#define FUZZED(reader) int lamina::fuzz::fuzz_##reader(const std::uint8_t* data, std::size_t size)
#endif

namespace lamina::fuzz {

inline constexpr const char* kScratch = "/dev/shm";

/// A file in memory.
inline InputFile as_file(const std::uint8_t* data, std::size_t size) {
  InputFile file{Descriptor(::memfd_create("fuzz", MFD_CLOEXEC)), size, "fuzz"};
  if (!file.file || write_all(file.file.get(), data, size) != 0) std::abort();
  return file;
}

/// Ends a fuzzer, which catches nothing, and fails a test.
[[noreturn]] inline void broken(const char* what) {
  throw std::logic_error(what);
}

/// All rows, in pieces of a size that divides nothing; arrays must be as long as they say.
inline void read_all(PointSource& source, std::size_t file_bytes) {
  const PointSourceInfo& info = source.info();
  // A row takes a byte at least, compressed ones a hundredth of it.
  if (info.count > 300 * (file_bytes + 1)) broken("a header was believed");
  SampleBatch batch;
  constexpr std::size_t kPiece = 613;
  for (std::uint64_t first = 0; first < info.count; first += batch.size()) {
    source.read(first, kPiece, batch);
    if (batch.size() != std::min<std::uint64_t>(kPiece, info.count - first)) broken("rows are missing");
    if (batch.attributes.size() != info.attributes.size()) broken("attributes are missing");
    for (const auto& values : batch.attributes) {
      if (values.size() != batch.size()) broken("an attribute is short");
    }
    if (batch.nx.size() != (info.has_normals ? batch.size() : 0)) broken("normals are short");
  }
  if (info.count > 0 && info.random_access) source.read(info.count - 1, 2, batch);
}

/// Runs a reader; a refusal is fine when it is one line from the user's side of things.
template <class Read>
int run(const Read& read) {
  try {
    read();
  } catch (const Error& e) {
    const std::string text = e.what();
    if (e.code() != ExitCode::unreadable && e.code() != ExitCode::usage) broken(text.c_str());
    if (text.empty() || text.find('\n') != std::string::npos) broken("a message is no line");
  }
  return 0;
}

}  // namespace lamina::fuzz
