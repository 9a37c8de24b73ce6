#include "vdb/vdb_file.h"

#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/Stream.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "base/output_file.h"
#include "lamina/error.h"
#include "lamina/run.h"
#include "vdb/points_grid.h"

namespace lamina::volume {

namespace {

/// io::File opens files by name and does not notice a full disk; the archive behind it writes to any stream.
struct WholeArchive : openvdb::io::Archive {
  using openvdb::io::Archive::write;
};

void tag_by_contents(std::string& bytes) {
  char* const at = bytes.data() + kTagAt;
  std::fill_n(at, kTagSize, '0');
  ContentTag tag;
  tag.add(bytes);
  const std::string text = tag.text();
  std::copy(text.begin(), text.end(), at);
}

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  std::string line = what;  // it may quote the file
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c >= 0 && c < ' '; }, '?');
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", path, line));
}

/// The file's magic number and what comes behind it: lengths in a file that is none would be taken for real.
std::string check_header(std::ifstream& file, const std::string& path) {
  constexpr std::uint32_t kMagic = 0x56444220;
  constexpr std::uint32_t kOldest = 222, kUnknown = 1000;
  std::uint64_t magic = 0;
  std::uint32_t version = 0, major = 0, minor = 0;
  for (auto [to, size] : {std::pair<void*, std::streamsize>{&magic, 8}, {&version, 4}, {&major, 4}, {&minor, 4}})
    file.read(static_cast<char*>(to), size);
  if (!file) refuse(path, "is too short for a .vdb file");
  if ((magic & 0xFFFFFFFFU) != kMagic) refuse(path, "is not a .vdb file");
  if (version < kOldest || version > kUnknown)
    refuse(path, fmt::format("is a .vdb file of version {}, which cannot be read", version));
  file.seekg(0);
  return fmt::format("{}.{}/{}", major, minor, version);
}

}  // namespace

VdbFile read_vdb(const std::string& path) {
  openvdb::initialize();
  std::error_code ec;
  if (path == "-") refuse("standard input", "a .vdb is read from a file only; write one and name it");
  if (std::filesystem::is_directory(path, ec)) refuse(path, "is a directory, not a .vdb file");
  std::ifstream file(path, std::ios::binary);
  if (!file) refuse(path, fmt::format("cannot be opened: {}", std::strerror(errno)));
  VdbFile out;
  out.version = check_header(file, path);
  out.bytes = std::filesystem::file_size(path, ec);
  // OpenVDB does not look whether its reads succeed.
  file.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
  try {
    check_vdb(file);
    openvdb::io::Stream stream(file, /*delayLoad=*/false);
    const openvdb::GridPtrVecPtr grids = stream.getGrids();
    if (grids != nullptr) out.grids = *grids;
  } catch (const std::ios::failure&) {
    refuse(path, "the .vdb file is truncated: it ends inside a grid");
  } catch (const std::exception& e) {
    refuse(path, fmt::format("the .vdb file cannot be read: {}", e.what()));
  }
  if (out.grids.empty()) refuse(path, "the .vdb file holds no grids");
  std::stable_sort(out.grids.begin(), out.grids.end(),
                   [](const auto& a, const auto& b) { return a->getName() < b->getName(); });
  return out;
}

std::string kind_of(const openvdb::GridBase& grid) {
  if (grid.isType<openvdb::points::PointDataGrid>()) return "points";
  if (grid.getGridClass() == openvdb::GRID_LEVEL_SET) return "a level set";
  if (grid.getGridClass() == openvdb::GRID_FOG_VOLUME) return "a fog volume";
  return grid.valueType() + " values";
}

std::string list_of(const openvdb::GridPtrVec& grids) {
  std::string text;
  for (const auto& grid : grids)
    text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", grid->getName(), kind_of(*grid));
  return text;
}

bool is_scalar(const openvdb::GridBase& grid) {
  return grid.isType<openvdb::FloatGrid>() || grid.isType<openvdb::DoubleGrid>();
}

openvdb::GridBase::Ptr choose_grid(const std::string& path, const openvdb::GridPtrVec& grids, const std::string& name,
                                   const std::string& wanted,
                                   const std::function<int(const openvdb::GridBase&, bool)>& fitness) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::unreadable, fmt::format("{}: {}; it holds {}", path, what, list_of(grids)));
  };
  auto found = std::find_if(grids.begin(), grids.end(), [&](const auto& g) { return g->getName() == name; });
  if (name.empty()) {
    found = std::max_element(grids.begin(), grids.end(),
                             [&](const auto& a, const auto& b) { return fitness(*a, false) < fitness(*b, false); });
    if (fitness(**found, false) == 0) refuse(fmt::format("holds no {}", wanted));
  } else {
    if (found == grids.end()) refuse(fmt::format("holds no grid called {}", name));
    if (fitness(**found, true) == 0) refuse(fmt::format("grid {} is no {}", name, wanted));
  }
  const openvdb::GridBase& grid = **found;
  if (!grid.transform().isLinear()) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: grid {} has a frustum (perspective) transform; resample it to cubic voxels first",
                            path, grid.getName()));
  }
  if (grid.activeVoxelCount() == 0)
    throw Error(ExitCode::unreadable, fmt::format("{}: grid {} has no active voxels", path, grid.getName()));
  return *found;
}

openvdb::FloatGrid::Ptr as_float(const openvdb::GridBase::Ptr& grid) {
  if (auto floats = openvdb::gridPtrCast<openvdb::FloatGrid>(grid)) return floats;
  const auto doubles = openvdb::gridPtrCast<openvdb::DoubleGrid>(grid);
  if (doubles == nullptr) return nullptr;
  auto out = std::make_shared<openvdb::FloatGrid>(*doubles);
  out->setTransform(doubles->transformPtr());
  return out;
}

openvdb::Vec3SGrid::ConstPtr colours_of(const openvdb::GridPtrVec& grids) {
  for (const auto& grid : grids) {
    if (grid->getName() != "Cd" || !grid->transform().isLinear()) continue;
    if (auto colours = openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid)) return colours;
  }
  return nullptr;
}

bool is_open(const openvdb::GridBase& grid) {
  const auto open = grid.getMetadata<openvdb::BoolMetadata>(kOpenMetadata);
  return open != nullptr && open->value();
}

void label(openvdb::GridBase& grid, const std::string& name, bool half) {
  grid.setName(name);
  grid.setCreator(fmt::format("lamina {}", version()));
  grid.setSaveFloatAsHalf(half);
}

void note_shift(openvdb::GridBase& grid, const std::array<double, 3>& shift) {
  grid.insertMeta("shift", openvdb::Vec3DMetadata(openvdb::Vec3d(shift[0], shift[1], shift[2])));
}

void note_crs(openvdb::GridBase& grid, const std::string& crs) {
  if (!crs.empty()) grid.insertMeta("crs", openvdb::StringMetadata(crs));
}

std::string vdb_bytes(const openvdb::GridCPtrVec& grids) {
  std::ostringstream stream(std::ios::binary);
  WholeArchive archive;
  archive.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
  archive.write(stream, grids, /*seekable=*/true);
  std::string bytes = std::move(stream).str();
  tag_by_contents(bytes);
  return bytes;
}

void ContentTag::mix(std::uint64_t word) {
  // Two sums in the manner of FNV-1a, of eight bytes at a time; turning brings high bits to where they count.
  constexpr std::uint64_t kPrime = 0x100000001b3ULL, kOther = 0x9e3779b97f4a7c15ULL;
  a_ = std::rotl((a_ ^ word) * kPrime, 29);
  b_ = std::rotl((b_ ^ ~word) * kOther, 31);
}

void ContentTag::add(std::string_view bytes) {
  std::size_t i = 0;
  const auto add_byte = [&] {
    const std::uint64_t place = length_++ % 8;
    word_ |= std::uint64_t{static_cast<std::uint8_t>(bytes[i++])} << (8 * place);
    if (place < 7) return;
    mix(word_);
    word_ = 0;
  };
  while (i < bytes.size() && length_ % 8 != 0) add_byte();
  for (; i + 8 <= bytes.size(); i += 8, length_ += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, sizeof word);
    mix(word);
  }
  while (i < bytes.size()) add_byte();
}

std::string ContentTag::text() const {
  ContentTag end = *this;
  end.mix(word_);
  end.mix(length_);
  const std::uint64_t a = end.a_, b = end.b_;
  // Version 8 of RFC 9562: the maker's own scheme.
  return fmt::format("{:08x}-{:04x}-8{:03x}-a{:03x}-{:012x}", a >> 32, (a >> 16) & 0xFFFF, a & 0xFFF, b >> 52,
                     b & 0xFFFFFFFFFFFFULL);
}

std::string numbered(const std::string& path, std::size_t number) {
  const std::filesystem::path p(path);
  const std::string name = fmt::format("{}.{:04}{}", p.stem().string(), number, p.extension().string());
  return (p.parent_path() / name).string();
}

std::uint64_t write_vdb(const openvdb::GridCPtrVec& grids, const std::string& path) {
  ResultFile out(path);
  const std::string bytes = vdb_bytes(grids);
  out.write(bytes);
  out.commit();
  return bytes.size();
}

}  // namespace lamina::volume
