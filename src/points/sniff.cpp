#include "points/sniff.h"

#include <fmt/format.h>

#include <array>
#include <charconv>

#include "lamina/error.h"

namespace lamina {
namespace {

using namespace std::string_view_literals;

struct Signature {
  std::string_view start;
  std::string_view what;
};

constexpr std::string_view kNotYet = "is not read yet; convert it to PLY";

constexpr std::array kSignatures{
    Signature{"# .PCD", "looks like a PCD file: PCD is not read yet; convert it to PLY"},
    Signature{"ASTM-E57", "looks like an E57 file: E57 is not read yet; convert it to PLY"},
    Signature{"\x1f\x8b"sv, "is compressed with gzip; unpack it, or pipe it in: zcat FILE | lamina ... -"},
    Signature{"PK\x03\x04"sv, "is a zip archive; unpack it"},
    Signature{"\x28\xb5\x2f\xfd"sv, "is compressed with zstd; unpack it, or pipe it in: zstdcat FILE | lamina ... -"},
    Signature{"\x20\x42\x44\x56"sv, "looks like an OpenVDB file, which holds no points read here; give a PLY"},
    Signature{"OFF", "looks like an OFF mesh; give a point cloud as PLY"},
    Signature{"solid ", "looks like an STL mesh; give a point cloud as PLY"},
    Signature{"version https://git-lfs", "is a Git LFS pointer, not the file itself; fetch it with: git lfs pull"},
    Signature{"<!DOCTYPE", "is a web page (a download that went wrong?)"},
    Signature{"<html", "is a web page (a download that went wrong?)"},
};

/// Numbers on the first line that is not a comment; 0 when something else stands there.
int numbers_on_first_line(std::string_view text) {
  while (!text.empty() && (text.front() == '#' || text.starts_with("//"))) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return 0;
    text.remove_prefix(end + 1);
  }
  text = text.substr(0, text.find_first_of("\r\n"));
  int numbers = 0;
  for (;;) {
    const std::size_t begin = text.find_first_not_of(" \t,;");
    if (begin == std::string_view::npos) return numbers;
    text.remove_prefix(begin);
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{}) return 0;
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    if (!text.empty() && " \t,;"sv.find(text.front()) == std::string_view::npos) return 0;
    ++numbers;
  }
}

/// LAZ shares LAS's signature and marks itself in the point format.
bool is_laz(std::string_view start) {
  constexpr std::size_t kPointFormat = 104;
  return start.size() > kPointFormat && (static_cast<unsigned char>(start[kPointFormat]) & 0x80U) != 0;
}

std::string describe(std::string_view start) {
  if (start.empty()) return "is empty; give a PLY point cloud";
  if (start.starts_with("LASF")) {
    const std::string_view format = is_laz(start) ? "LAZ" : "LAS";
    return fmt::format("looks like a {0} file: {0} {1}", format, kNotYet);
  }
  for (const Signature& signature : kSignatures) {
    if (start.starts_with(signature.start)) return std::string(signature.what);
  }
  if (const int numbers = numbers_on_first_line(start); numbers >= 3) {
    return fmt::format("looks like a plain text cloud ({} numbers on a line): XYZ {}", numbers, kNotYet);
  }
  return "is not a PLY file (it does not begin with 'ply')";
}

}  // namespace

void require_ply(std::string_view start, const std::string& name) {
  if (start.size() > 3 && start.starts_with("ply") && "\r\n \t"sv.find(start[3]) != std::string_view::npos) return;
  if (start == "ply") throw Error(ExitCode::unreadable, name + ": the PLY header ends after its first line");
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", name, describe(start)));
}

}  // namespace lamina
