// OpenVDB's reader behind our walk through the file. OpenVDB itself is not instrumented; what it asks for is: the
// allocator's checks see every byte it writes past its arrays.
#include "volume/vdb_file.h"

#include <fmt/format.h>

#include "harness.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace lamina;
  const InputFile file = fuzz::as_file(data, size);
  return fuzz::run([&] { volume::read_vdb(fmt::format("/proc/self/fd/{}", file.file.get())); });
}
