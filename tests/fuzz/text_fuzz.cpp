// A first line that begins with @ is what the user says about the columns.
#include <string_view>

#include "harness.h"
#include "points/formats.h"

FUZZED(text) {
  using namespace lamina;
  std::string_view text(reinterpret_cast<const char*>(data), size);
  std::string columns;
  if (text.starts_with('@')) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    columns = text.substr(1, end - 1);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return fuzz::run([&] {
    InputFile file = fuzz::as_file(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    fuzz::read_all(*open_text(std::move(file), "fuzz", columns), size);
  });
}
